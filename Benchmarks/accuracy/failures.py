"""What went wrong, to be looked at: the worst structures of each volume, in a slice through the middle of the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.report_files import save_figure
from Benchmarks.shared.segmentation_metrics import dice
from Benchmarks.shared.simulated_clicker import Clicks
from ViTTransferFunction.Logic.core.volumes.intensity_window import display_window
from ViTTransferFunction.Logic.core.volumes.volume import Volume

STRUCTURES = 2
"""Of each volume."""
COLUMNS = 6
MARGIN_MM = 40.0
"""Around truth and result."""
TRUTH_COLOUR, RESULT_COLOUR = "#2ecc40", "#ff4136"


@dataclass(frozen=True, eq=False)
class Failure:
    """A structure in one slice.

    Attributes:
        title: what it is, and its Dice.
        grey: (rows, columns), 0 to 1.
        truth, result: (rows, columns) bool.
        pixel_mm: height and width of a pixel.
    """

    title: str
    grey: np.ndarray
    truth: np.ndarray
    result: np.ndarray
    pixel_mm: tuple[float, float]


def worst_structures(case: str, labelled: LabelledVolume, clicks: Clicks, labels: np.ndarray) -> list[Failure]:
    """The structures of a volume on which labels (K, J, I) agree least with the truth, the worst first."""
    by_dice = sorted((dice(labels == label, labelled.truth == label), label) for label in range(1, len(labelled.names) + 1))
    failures = []
    for value, label in by_dice[:STRUCTURES]:
        count = len(clicks[label - 1])
        title = f"{case}\n{labelled.names[label - 1]}: {value:.2f} @{count}"
        failures.append(_in_a_slice(title, labelled, labels == label, labelled.truth == label))
    return failures


def _in_a_slice(title: str, labelled: LabelledVolume, result: np.ndarray, truth: np.ndarray) -> Failure:
    """In the slice through the middle of the truth's voxels, of the orientation that shows most of it."""
    counts = [truth.sum(axis=tuple(other for other in range(3) if other != axis)) for axis in range(3)]
    across = max(range(3), key=lambda axis: counts[axis].max() / labelled.spacing_mm[axis])
    middle = int(np.searchsorted(np.cumsum(counts[across]), counts[across].sum() / 2))
    volume = labelled.volume
    cuts = [np.take(array, middle, across) for array in (volume.array, truth, result)]
    grey, *masks = (_as_radiologists_see(cut, volume, across) for cut in cuts)
    height_mm, width_mm = (mm for axis, mm in enumerate(labelled.spacing_mm) if axis != across)
    part = _extent(masks[0] | masks[1], 0, height_mm), _extent(masks[0] | masks[1], 1, width_mm)
    shown = display_window(volume).apply(grey[part])
    return Failure(title, shown, masks[0][part], masks[1][part], (height_mm, width_mm))


def _as_radiologists_see(cut: np.ndarray, volume: Volume, across: int) -> np.ndarray:
    """The head or the face at the top, the patient's right, or the face, on the left."""
    directions = volume.geometry.ijk_to_ras[:3, :3].T[::-1]
    towards = [direction[np.abs(direction).argmax()] for axis, direction in enumerate(directions) if axis != across]
    return np.flip(cut, tuple(axis for axis, sign in enumerate(towards) if sign > 0))


def _extent(mask: np.ndarray, axis: int, pixel_mm: float) -> slice:
    present = np.flatnonzero(mask.any(axis=1 - axis))
    margin = int(MARGIN_MM / pixel_mm)
    return slice(max(int(present[0]) - margin, 0), int(present[-1]) + margin + 1)


def plot_failures(failures: Sequence[Failure], path: Path) -> None:
    """All in one PNG file, truth and result outlined."""
    import matplotlib.pyplot as plt

    rows = -(-len(failures) // COLUMNS)
    figure, grid = plt.subplots(rows, COLUMNS, figsize=(2.3 * COLUMNS, 2.55 * rows), squeeze=False, layout="constrained")
    for axes in grid.flat:
        axes.axis("off")
    for axes, failure in zip(grid.flat, failures, strict=False):
        _draw(axes, failure)
    figure.suptitle("Worst structures of each volume: truth green, result red", fontsize=11)
    save_figure(figure, path)


def _draw(axes: Any, failure: Failure) -> None:
    height_mm, width_mm = failure.pixel_mm
    axes.imshow(failure.grey, cmap="gray", vmin=0, vmax=1, aspect=height_mm / width_mm)
    for mask, colour in ((failure.truth, TRUTH_COLOUR), (failure.result, RESULT_COLOUR)):
        if mask.any() and not mask.all():
            axes.contour(mask, levels=[0.5], colors=colour, linewidths=1.0)
    axes.set_title(failure.title, fontsize=8)
