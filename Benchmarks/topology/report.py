"""What was measured, as tables and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import save_figure, write_results
from Benchmarks.shared.report_tables import number, paragraphs, table

Pictures = dict[tuple[str, str, str], np.ndarray]
"""(shape, features, refinement) → a slice of what was found, bool; features "truth" for what it should be."""
_BETTI_NUMBERS = {"components": "parts", "tunnels": "tunnels", "cavities": "cavities"}
_DISTANCES = {"mean_voxels": "mean", "p95_voxels": "95th percentile", "within_one_voxel": "share ≤ 1 voxel"}
COLUMNS = (
    ("truth", "", "truth"),
    ("one axis", "none", "one axis"),
    ("three axes", "none", "three axes"),
    ("three axes", "bilateral", "three axes, refined"),
)


def write_report(report: dict[str, Any], pictures: Pictures, folder: Path) -> None:
    """Write topology.json, topology.md and topology.webp."""
    write_results(folder, "topology", {**report, "summary": summary(report)}, _text(report))
    _plot(pictures, folder / "topology.webp")


def summary(report: dict[str, Any]) -> dict[str, Any]:
    """The figures that are tracked: of three axes, refined."""
    ours = [row for row in report["shapes"] if row["features"] == "three axes" and row["refinement"] == "bilateral"]
    refined = [row for row in report["details"] if row["refinement"] == "bilateral" and "mean_voxels" in row]
    return {
        "euler": {f"{row['shape']}, noise {row['noise']:g}": row["euler"] for row in ours},
        "shape_dice": {f"{row['shape']}, noise {row['noise']:g}": round(row["dice"], 4) for row in ours},
        # Rows come by clicks: the last one of each structure stays.
        "boundary_distance_voxels": {row["structure"]: round(row["mean_voxels"], 3) for row in refined},
    }


def _text(report: dict[str, Any]) -> str:
    shape_header = ["shape", "noise", "slices across", "refinement", "Dice", "Euler number", *_BETTI_NUMBERS.values()]
    detail_header = ["structure", "clicks", "refinement", "Dice", *_DISTANCES.values()]
    return paragraphs(
        "# Shapes and fine detail",
        f"Features of {report['model']}, default preset. {in_words(report['machine'])}. "
        "Command: `python dev.py bench topology`.",
        f"## Sphere and torus, {report['size']}³ voxels, {report['clicks']} clicks",
        "Voxels touch by faces, edges and corners. In parentheses the true Euler number. Noise is in percent of the shape's "
        "brightness.",
        table([*shape_header, "features, s"], map(_shape_row, report["shapes"])),
        "![Middle slices](topology.webp)",
        "## Thin structures against a 1D transfer function",
        "Distance in voxels between the two boundaries, over both.",
        table(detail_header, map(_detail_row, report["details"])),
    )


def _shape_row(row: dict[str, Any]) -> list[object]:
    euler = f"{row['euler']} ({row['true_euler']})"
    what = row["shape"], f"{row['noise']:g}", row["features"], row["refinement"]
    return [*what, number(row["dice"], 4), euler, *(row[name] for name in _BETTI_NUMBERS), number(row["feature_seconds"], 1)]


def _detail_row(row: dict[str, Any]) -> list[object]:
    what = row["structure"], row["clicks"], row["refinement"]
    return [*what, number(row["dice"]), *(number(row.get(name), 2) for name in _DISTANCES)]


def _plot(pictures: Pictures, path: Path) -> None:
    """Middle slices, one row for each shape; false voxels red, missed ones blue."""
    import matplotlib.pyplot as plt

    shapes = list(dict.fromkeys(shape for shape, _, _ in pictures))
    figure, grid = plt.subplots(len(shapes), len(COLUMNS), figsize=(2.6 * len(COLUMNS), 2.8 * len(shapes)), squeeze=False)
    for row, shape in zip(grid, shapes, strict=True):
        truth = pictures[shape, "truth", ""]
        for axes, (features, refinement, title) in zip(row, COLUMNS, strict=True):
            found = pictures[shape, features, refinement]
            picture = np.ones((*truth.shape, 3))
            picture[found & truth] = (0.75, 0.75, 0.75)
            picture[found & ~truth] = (0.8, 0.15, 0.15)
            picture[truth & ~found] = (0.15, 0.35, 0.8)
            axes.imshow(picture, interpolation="antialiased")
            axes.set_xticks([])
            axes.set_yticks([])
            axes.set_title(title, fontsize=9)
        row[0].set_ylabel(shape, fontsize=9)
    figure.tight_layout()
    save_figure(figure, path)
