"""What `bench_solver` measured, as tables and plots."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def write_report(measured: dict[str, Any], folder: Path) -> None:
    """Write solver.json, solver.md and the plots."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "solver.json").write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
    (folder / "solver.md").write_text(_tables(measured), encoding="utf-8")
    _plot_error(measured["iterations"], folder / "solver_error.png")
    _plot_active(measured["active"], folder / "solver_active.png")


def _tables(measured: dict[str, Any]) -> str:
    machine = measured["machine"]
    parts = [
        "# Bilateral solver",
        f"{machine['processor']}, PyTorch {machine['torch']}, {machine['threads']} thread(s). Seconds are wall clock, best of "
        "several runs in turn; processor seconds in parentheses. The volume is fully occupied: no threshold.",
        _table(
            [
                "size",
                "cells",
                "iterations",
                "nearest",
                "multilinear",
                "published",
                "speed-up",
                "guided filter",
                "floor",
                "RMS error",
            ],
            [_speed_row(row) for row in measured["speed"]],
        ),
        "Floor: read the volume, read the map, write the map. RMS error: against the converged float64 answer.",
        "## Where the time goes",
        _table(["stage", "seconds"], [[name, f"{seconds:.3f}"] for name, seconds in measured["stages"].items()]),
        "## Error after iterations",
        _table(
            ["λ", "precision", "iterations", "RMS error", "processor seconds"],
            [
                [f"{r['smoothness']:g}", r["precision"], r["iterations"], f"{r['rms']:.1e}", _seconds(r.get("cpu_seconds"))]
                for r in measured["iterations"]
            ],
        ),
        "## Dice on the phantom",
        _table(["method", "best Dice"], [[r["method"], f"{r['dice']:.4f}"] for r in measured["quality"]]),
        "## Only near the structure",
        _table(
            ["sphere's radius / edge", "cells", "nearest", "multilinear"],
            [[r["radius"], r["cells"], f"{r['nearest_s']:.3f}", f"{r['multilinear_s']:.3f}"] for r in measured["active"]],
        ),
        "## Memory beyond the inputs, the refined map included",
        _table(["size", "slice", "MB"], [[r["size"], r["slicing"], f"{r['bytes'] / 1e6:.0f}"] for r in measured["memory"]]),
    ]
    if measured["real"]:
        head = ["case", "trilinear", "guided_filter", "solver"]
        rows = [[r["case"], *(f"{r[name]:.4f}" for name in head[1:]), f"{r['solver_s']:.3f}"] for r in measured["real"]]
        parts += ["## Best Dice on real intensities", _table([*head, "seconds"], rows)]
    return "\n\n".join(parts) + "\n"


def _speed_row(row: dict[str, Any]) -> list[str]:
    def both(name: str) -> str:
        return f"{row[f'{name}_s']:.3f} ({row[f'{name}_cpu_s']:.3f})" if f"{name}_s" in row else "–"

    speed_up = f"{row['published_s'] / row['nearest_s']:.0f}×" if "published_s" in row else "–"
    error = f"{row['rms']:.1e}" if "rms" in row else "–"
    timed = [both(name) for name in ("nearest", "multilinear", "published")]
    return [
        f"{row['size']}³",
        str(row["cells"]),
        str(row["iterations"]),
        *timed,
        speed_up,
        both("guided_filter"),
        both("floor"),
        error,
    ]


def _seconds(seconds: float | None) -> str:
    return "–" if seconds is None else f"{seconds:.3f}"


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def _plot_error(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for smoothness in sorted({r["smoothness"] for r in rows}):
        for precision, style in (("float32", "o-"), ("float64", "x:")):
            curve = [r for r in rows if r["smoothness"] == smoothness and r["precision"] == precision]
            label = f"λ {smoothness:g}, {precision}"
            axes.semilogy([r["cpu_seconds"] for r in curve], [r["rms"] for r in curve], style, label=label, markersize=4)
    axes.axhline(1e-4, color="grey", linewidth=0.8)
    axes.set(xlabel="processor seconds, nearest slice", ylabel="RMS error", title="Error after 1 to 25 iterations")
    axes.legend(fontsize="small")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _plot_active(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for name in ("nearest", "multilinear"):
        axes.plot([r["cells"] for r in rows], [r[f"{name}_s"] for r in rows], "o-", label=name)
    axes.set(xlabel="active cells", ylabel="seconds", title="Time where only cells near the structure are solved for")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)
