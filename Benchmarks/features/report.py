"""What was measured, as tables and a plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import save_figure, write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS

DEFAULT_GRID = PRESETS[DEFAULT_PRESET].features.grid
REPORTED_CLICKS = ("1", "3", "5", "10")


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write features.json, features.md and features.png."""
    write_results(folder, "features", report, _text(report))
    _plot(report["rows"], folder / "features.png")


def dice_over_clicks(row: dict[str, Any]) -> float:
    """Mean over all numbers of clicks: a single number of clicks is a matter of luck, by a few hundredths."""
    return float(np.mean(list(row["dice"].values())))


def _text(report: dict[str, Any]) -> str:
    return paragraphs(
        "# Cost of features",
        f"Features of {report['model']}. {in_words(report['machine'])}. Command: `{report['command']}`. "
        f"{DEFAULT_GRID} cells along the longest edge; rows named by a grid are the default with so many.",
        f"The default is *{report['default']}*. Errors are mean 1 − cosine to *every slice*, over cells of the body. "
        "Dice is the mean over the structures after so many simulated clicks each, and its mean over 1 to 10 clicks.",
        _volumes_compared(report),
        "\n".join(f"- {name}: {value:.4g}" for name, value in report["summary"].items()),
        _settings_table(report["rows"]),
        "## Coarse to fine",
        _first_maps_table(report["first_maps"]),
        f"Stages on {report['stages']['case']}, one patch a cell: error against the last.",
        table(["s", "error"], [[f"{s['seconds']:.1f}", f"{s['error']:.4f}"] for s in report["stages"]["stages"]]),
        "## Scaling of the default, generated volumes",
        _scaling_table(report["scaling"]),
    )


def _volumes_compared(report: dict[str, Any]) -> str:
    """What the summary's figures against the published method are over."""
    published = report["published_cases"]
    volumes = f"over {', '.join(published)}" if published else "missing: it was not run"
    return f"Figures against *every slice* are over all volumes, those against *published* {volumes}."


def _settings_table(rows: Sequence[dict[str, Any]]) -> str:
    header = ["volume", "setting", "tokens", "s", "estimated s", "peak MB", "estimated MB", "centred error", "whitened error"]
    header += [*(f"Dice @{clicks}" for clicks in REPORTED_CLICKS), "mean Dice"]
    lines = [
        [
            row["case"],
            row["setting"],
            f"{row['tokens']:,}",
            f"{row['seconds']:.1f}",
            f"{row['estimated_seconds']:.1f}",
            f"{row['peak_bytes'] / 1e6:.0f}",
            f"{row['estimated_peak_bytes'] / 1e6:.0f}",
            f"{row['centred']:.4f}",
            f"{row['whitened']:.4f}",
            *(f"{row['dice'][clicks]:.3f}" for clicks in REPORTED_CLICKS),
            f"{dice_over_clicks(row):.3f}",
        ]
        for row in rows
    ]
    return table(header, lines)


def _first_maps_table(rows: Sequence[dict[str, Any]]) -> str:
    lines = [
        [row["case"], "×".join(map(str, row["voxels"])), f"{row['first_map_s']:.1f}", f"{row['last_map_s']:.1f}"]
        for row in rows
    ]
    return table(["volume", "voxels", "first map, s", "last map, s"], lines)


def _scaling_table(rows: Sequence[dict[str, Any]]) -> str:
    lines = [
        [
            f"{row['size']}³",
            f"{row['tokens']:,}",
            f"{row['seconds']:.1f}",
            f"{1e3 * row['seconds'] / row['tokens']:.3f}",
            f"{(row['peak_bytes'] - row['feature_bytes']) / 1e6:.0f}",
        ]
        for row in rows
    ]
    return table(["size", "tokens", "s", "ms a token", "memory beyond the features, MB"], lines)


def _plot(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Pareto plot: time against Dice, and against the error."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 5))
    for case in dict.fromkeys(row["case"] for row in rows):
        of_case = sorted((row for row in rows if row["case"] == case), key=lambda row: row["seconds"])
        seconds = [row["seconds"] for row in of_case]
        axes[0].plot(seconds, [1.0 - dice_over_clicks(row) for row in of_case], "o-", label=case)
        axes[1].plot(seconds, [max(row["whitened"], 1e-4) for row in of_case], "o", label=case)
        for row in of_case:
            axes[1].annotate(row["setting"], (row["seconds"], max(row["whitened"], 1e-4)), fontsize=5)
    for ax, label in zip(axes, ("1 − mean Dice over 1 to 10 clicks", "whitened cosine error"), strict=True):
        ax.set(xscale="log", yscale="log", xlabel="seconds", ylabel=label)
        ax.legend()
    figure.tight_layout()
    save_figure(figure, path)
