"""What `bench_topology` measured, as tables and pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.shared.report_tables import number, table
from ViTTransferFunction.Logic.core.atomic_file import replacing

Pictures = dict[tuple[str, str, str], np.ndarray]
"""(shape, features, refinement) → a slice of what was found, bool; features "truth" for what it should be."""
BETTI_NUMBERS = ("components", "tunnels", "cavities")
COLUMNS = (
    ("truth", "", "truth"),
    ("one axis", "none", "one axis"),
    ("three axes", "none", "three axes"),
    ("three axes", "bilateral", "three axes, refined"),
)


def write_report(report: dict[str, Any], pictures: Pictures, folder: Path) -> None:
    """Write topology.json, topology.md and topology.png."""
    report = {**report, "summary": summary(report)}
    with replacing(folder / "topology.json") as path:
        path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    with replacing(folder / "topology.md") as path:
        path.write_text(_text(report), encoding="utf-8")
    _plot(pictures, folder / "topology.png")


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
    shapes = [
        [
            row["shape"],
            f"{row['noise']:g}",
            row["features"],
            row["refinement"],
            number(row["dice"], 4),
            f"{row['euler']} ({row['true_euler']})",
            *(str(row[name]) for name in BETTI_NUMBERS),
            number(row["feature_seconds"], 1),
        ]
        for row in report["shapes"]
    ]
    details = [
        [
            row["structure"],
            str(row["clicks"]),
            row["refinement"],
            number(row["dice"]),
            *(number(row.get(name), 2) for name in ("mean_voxels", "p95_voxels", "within_one_voxel")),
        ]
        for row in report["details"]
    ]
    return (
        "\n\n".join(
            [
                "# Shapes and fine detail",
                f"Features of {report['model']}, default preset. Command: `python dev.py bench topology`.",
                f"## Sphere and torus, {report['size']}³ voxels, {report['clicks']} clicks",
                "Voxels touch by faces, edges and corners. In parentheses the true Euler number. Noise is in percent of the "
                "shape's brightness.",
                table(
                    [
                        "shape",
                        "slices across",
                        "refinement",
                        "Dice",
                        "Euler number",
                        "parts",
                        "tunnels",
                        "cavities",
                        "features, s",
                    ],
                    shapes,
                ),
                "![Middle slices](topology.png)",
                "## Thin structures against a 1D transfer function",
                "Distance in voxels between the two boundaries, over both.",
                table(["structure", "clicks", "refinement", "Dice", "mean", "95th percentile", "share ≤ 1 voxel"], details),
            ]
        )
        + "\n"
    )


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
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=120)
    plt.close(figure)
