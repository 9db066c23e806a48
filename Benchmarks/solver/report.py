"""What was measured, as tables and plots."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import save_figure, write_results
from Benchmarks.shared.report_tables import number, paragraphs, table


def write_report(measured: dict[str, Any], folder: Path) -> None:
    """Write solver.json, solver.md and the plots."""
    write_results(folder, "solver", measured, _text(measured))
    _plot_error(measured["iterations"], folder / "solver_error.png")
    _plot_active(measured["active"], folder / "solver_active.png")


SPEED_HEADER = ("size", "cells", "iterations", "nearest", "multilinear", "published", "speed-up", "guided filter", "floor")


def _text(measured: dict[str, Any]) -> str:
    return paragraphs(
        "# Bilateral solver",
        f"{in_words(measured['machine'])}. Seconds are wall clock, best of several runs in turn; processor seconds in "
        "parentheses. The volume is fully occupied: no threshold. *Multilinear* is the product's slice.",
        table([*SPEED_HEADER, "RMS error"], map(_speed_row, measured["speed"])),
        "Floor: read the volume, read the map, write the map. RMS error: against the converged float64 answer.",
        "## Where the time goes",
        table(["stage", "seconds"], [[name, number(seconds)] for name, seconds in measured["stages"].items()]),
        "## Error after iterations",
        table(["λ", "precision", "iterations", "RMS error", "processor seconds"], map(_iterations_row, measured["iterations"])),
        "## Dice on the phantom",
        table(["method", "best Dice"], [[r["method"], number(r["dice"], 4)] for r in measured["quality"]]),
        "## Only near the structure",
        table(
            ["sphere's radius / edge", "cells", "nearest", "multilinear"],
            [[r["radius"], r["cells"], number(r["nearest_s"]), number(r["multilinear_s"])] for r in measured["active"]],
        ),
        "## Memory beyond the inputs, the refined map included",
        table(["size", "slice", "MB"], [[r["size"], r["slicing"], number(r["bytes"] / 1e6, 0)] for r in measured["memory"]]),
        *(_real_edges(measured["real"]) if measured["real"] else ()),
    )


def _real_edges(rows: list[dict[str, Any]]) -> tuple[str, str]:
    methods = ("trilinear", "guided_filter", "solver")
    cells = [[row["case"], *(number(row[name], 4) for name in methods), number(row["solver_s"])] for row in rows]
    return "## Best Dice on real intensities", table(["case", *methods, "seconds"], cells)


def _iterations_row(row: dict[str, Any]) -> list[object]:
    seconds = number(row.get("cpu_seconds"))
    return [f"{row['smoothness']:g}", row["precision"], row["iterations"], f"{row['rms']:.1e}", seconds]


def _speed_row(row: dict[str, Any]) -> list[object]:
    def both(name: str) -> str:
        return f"{row[f'{name}_s']:.3f} ({row[f'{name}_cpu_s']:.3f})" if f"{name}_s" in row else "–"

    speed_up = f"{row['published_s'] / row['nearest_s']:.0f}×" if "published_s" in row else "–"
    error = f"{row['rms']:.1e}" if "rms" in row else "–"
    timed = [both(name) for name in ("nearest", "multilinear", "published")]
    return [f"{row['size']}³", row["cells"], row["iterations"], *timed, speed_up, both("guided_filter"), both("floor"), error]


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
    save_figure(figure, path)


def _plot_active(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for name in ("nearest", "multilinear"):
        axes.plot([r["cells"] for r in rows], [r[f"{name}_s"] for r in rows], "o-", label=name)
    axes.set(xlabel="active cells", ylabel="seconds", title="Time where only cells near the structure are solved for")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    save_figure(figure, path)
