"""Where in a structure, or in an error, a simulated user's click lands: at its deepest place, or about where a person aims."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from Benchmarks.shared.regions import Voxel, deepest_voxel, depth_mm, largest_component, voxel_at

ERROR_MM = 3.0
"""Standard deviation along each axis of where a person clicks around where they aim."""
INNER_SHARE = 0.5
"""Of the largest depth: where a person begins, who looks for neither the centre nor the edge."""
MOST_TRIES = 50
"""Of a click that has to hit an error; in one of a few voxels, a person takes care."""


class Aim(Protocol):
    """How the clicks of one class are aimed."""

    def at_structure(self, structure: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
        """The first click, on a structure (K, J, I) bool of at least one voxel."""

    def at_error(self, error: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
        """A later click, on one connected error (K, J, I) bool of at least one voxel."""


class DeepestAim:
    """Always the deepest place: the best click there is, and one path of clicks only."""

    def at_structure(self, structure: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
        """The deepest place of the largest component."""
        return deepest_voxel(largest_component(structure), spacing_mm)

    def at_error(self, error: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
        """The error's deepest place."""
        return deepest_voxel(error, spacing_mm)


class PersonsAim:
    """As a person clicks; equal seeds give equal clicks.

    Args:
        seed: non-negative integers, such as the number of the path and of the class.
    """

    def __init__(self, *seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def at_structure(self, structure: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
        """Anywhere in the inner half: uniformly among the voxels at least half as deep as the largest component is."""
        depths = depth_mm(structure, spacing_mm)
        deepest = depths[largest_component(structure)].max()
        return voxel_at(int(self._random.choice(np.flatnonzero(depths >= INNER_SHARE * deepest))), structure.shape)

    def at_error(self, error: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
        """Around the error's deepest place, normally distributed, but within the error."""
        deepest = deepest_voxel(error, spacing_mm)
        errors_mm = self._random.normal(0.0, ERROR_MM, (MOST_TRIES, 3))
        voxels = np.round(deepest + errors_mm / np.asarray(spacing_mm)).astype(int)
        voxels = voxels[((voxels >= 0) & (voxels < error.shape)).all(axis=1)]
        hits = voxels[error[tuple(voxels.T)]]
        if not len(hits):
            return deepest
        k, j, i = (int(n) for n in hits[0])
        return k, j, i


DEEPEST = DeepestAim()


def persons_aims(path: int, classes: int) -> list[Aim]:
    """How a person aims at each of some classes on one path of clicks; the same path is always the same person."""
    return [PersonsAim(path, label) for label in range(1, classes + 1)]
