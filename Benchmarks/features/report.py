"""What was measured, as tables and a plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.features.errors import CLICKS
from Benchmarks.features.settings import DEFAULT, DEFAULT_SETTINGS, FINE
from Benchmarks.features.summary import mean_dice
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import save_figure, write_results
from Benchmarks.shared.report_tables import paragraphs, table, with_spread


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write features.json, features.md and features.png."""
    write_results(folder, "features", report, _text(report))
    _plot(report["rows"], folder / "features.png")


def _text(report: dict[str, Any]) -> str:
    return paragraphs(
        "# Cost of features",
        f"Features of {report['model']}. {in_words(report['machine'])}. Command: `{report['command']}`. "
        f"{DEFAULT_SETTINGS.grid} cells along the longest edge, but in rows that name another grid; "
        f"*{DEFAULT}* sees about {DEFAULT_SETTINGS.most_patches:,} patches in all slices together.",
        "\n".join(f"- {name}: {value:.4g}" for name, value in report["summary"].items()),
        "## Seconds, by class of processor",
        "Weights and volume loaded; the first map from the request for features to the map of a click. Each row is one run, "
        "whose libraries were limited to what the class has. *Published* is extrapolated from every few of its slices, which "
        "are all alike.",
        _times_table(report["times"]),
        "## What they buy",
        f"Errors are mean 1 − cosine to *{FINE}*, over cells of the body. Dice is the mean over the structures after so many "
        f"clicks each, over {report['paths']} paths; its mean over these comes with the standard deviation between paths.",
        _settings_table(report["rows"]),
    )


def _times_table(rows: Sequence[dict[str, Any]]) -> str:
    header = ["processor", "volume", "voxels", "precision", "patches", "first map, s", "features, s", "said before, s"]
    header += ["calibration, s", "published, s", "times as fast"]
    lines = []
    for row in rows:
        published = row.get("published_seconds")
        lines.append(
            [
                row["capability"],
                row["volume"],
                "×".join(map(str, row["voxels"])),
                row["precision"],
                f"{row['tokens']:,}",
                *(f"{row[name]:.1f}" for name in ("first_map_s", "seconds", "estimated_seconds")),
                f"{row['calibration_s']:.2f}",
                f"{published:.0f}" if published else "–",
                f"{published / row['seconds']:.0f}" if published else "–",
            ]
        )
    return table(header, lines)


def _settings_table(rows: Sequence[dict[str, Any]]) -> str:
    header = ["volume", "setting", "patches", "s", "peak MB", "said before", "centred error", "whitened error"]
    header += [*(f"Dice @{clicks}" for clicks in CLICKS), "mean"]
    return table(header, [_settings_line(row) for row in rows])


def _settings_line(row: dict[str, Any]) -> list[str]:
    of_paths = [mean_dice(row, path) for path in range(len(row["dice"]))]
    return [
        row["case"],
        row["setting"],
        f"{row['tokens']:,}",
        f"{row['seconds']:.1f}",
        f"{row['peak_bytes'] / 1e6:.0f}",
        f"{row['estimated_peak_bytes'] / 1e6:.0f}",
        f"{row['centred']:.4f}",
        f"{row['whitened']:.4f}",
        *(f"{np.mean([path[str(clicks)] for path in row['dice']]):.3f}" for clicks in CLICKS),
        with_spread(float(np.mean(of_paths)), float(np.std(of_paths))),
    ]


def _plot(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Seconds against Dice, a line for each volume."""
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots(figsize=(7, 5))
    for case in dict.fromkeys(row["case"] for row in rows):
        of_case = sorted((row for row in rows if row["case"] == case), key=lambda row: row["seconds"])
        ax.plot([row["seconds"] for row in of_case], [mean_dice(row) for row in of_case], "o-", label=case)
        for row in of_case:
            ax.annotate(row["setting"], (row["seconds"], mean_dice(row)), fontsize=6)
    ax.set(xscale="log", xlabel="seconds", ylabel=f"mean Dice at {', '.join(map(str, CLICKS))} clicks")
    ax.legend()
    figure.tight_layout()
    save_figure(figure, path)
