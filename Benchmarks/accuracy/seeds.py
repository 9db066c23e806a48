"""Clicks as other methods want them: voxels with the class that each belongs to.

Methods without negative clicks are given what is really at such a click, as their user would: another structure or background.
That is more than a negative click says to ours. They also get random voxels as background, as many as our method takes random
cells: from anywhere, as ours are, or from where the truth has none of the structures, as the paper does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from Benchmarks.shared.simulated_clicker import Click

BACKGROUND_VOXELS = 100


@dataclass(frozen=True, eq=False)
class Seeds:
    """Voxels and what they belong to.

    Attributes:
        kji: (N, 3) int64, voxel indices along (K, J, I).
        labels: (N,) int64, 0 for background.
        is_click: (N,) bool: placed by the user; else drawn from the background.
    """

    kji: np.ndarray
    labels: np.ndarray
    is_click: np.ndarray

    def of_class(self, label: int) -> np.ndarray:
        """(n, 3) indices of the voxels that belong to one class."""
        return self.kji[self.labels == label]


def seeds_of(clicks: Sequence[Sequence[Click]], truth: np.ndarray, true_background: bool = True) -> Seeds:
    """The clicks of all classes, with what is there according to `truth` (K, J, I), and background.

    Args:
        clicks: of each class.
        truth: (K, J, I) labels.
        true_background: draw the background from where it is; else from anywhere.
    """
    placed = np.array([click.kji for of_class in clicks for click in of_class], dtype=np.int64).reshape(-1, 3)
    background = random_voxels(truth == 0 if true_background else np.ones(truth.shape, dtype=bool), BACKGROUND_VOXELS)
    return Seeds(
        np.concatenate([placed, background]),
        np.concatenate([truth[tuple(placed.T)].astype(np.int64), np.zeros(len(background), dtype=np.int64)]),
        np.arange(len(placed) + len(background)) < len(placed),
    )


def painted(seeds: Seeds, truth: np.ndarray, spacing_mm: Sequence[float], radius_mm: float) -> Seeds:
    """Clicks made with a brush: a ball around each, as far as it belongs to the same; a careful user paints over no edge.

    Args:
        seeds: clicks, and what else there is, which stays as it is.
        truth: (K, J, I) labels.
        spacing_mm: along (K, J, I).
        radius_mm: of the brush.
    """
    reach = np.floor(radius_mm / np.asarray(spacing_mm)).astype(int)
    steps = np.stack(np.meshgrid(*[np.arange(-r, r + 1) for r in reach], indexing="ij"), axis=-1).reshape(-1, 3)
    ball = steps[np.linalg.norm(steps * spacing_mm, axis=1) <= radius_mm]
    voxels = (seeds.kji[seeds.is_click][:, None] + ball).reshape(-1, 3)
    labels = np.repeat(seeds.labels[seeds.is_click], len(ball))
    inside = ((voxels >= 0) & (voxels < truth.shape)).all(axis=1)
    voxels, labels = voxels[inside], labels[inside]
    same = truth[tuple(voxels.T)] == labels
    others = ~seeds.is_click
    return Seeds(
        np.concatenate([voxels[same], seeds.kji[others]]),
        np.concatenate([labels[same], seeds.labels[others]]),
        np.repeat([True, False], [np.count_nonzero(same), np.count_nonzero(others)]),
    )


def random_seeds(truth: np.ndarray, samples: int) -> Seeds:
    """So many random voxels of every class and of the background, or all that there are: what nobody would click."""
    of_label = [random_voxels(truth == label, samples) for label in range(int(truth.max()) + 1)]
    labels = np.repeat(np.arange(len(of_label)), [len(kji) for kji in of_label])
    return Seeds(np.concatenate(of_label), labels, np.zeros(len(labels), dtype=bool))


def random_voxels(mask: np.ndarray, count: int) -> np.ndarray:
    """(≤ count, 3) int64 different voxels of a mask (K, J, I), the same ones each time."""
    inside = np.flatnonzero(mask)
    chosen = np.random.default_rng(0).choice(inside, min(count, len(inside)), replace=False)
    return np.stack(np.unravel_index(chosen, mask.shape), axis=1)
