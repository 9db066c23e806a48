"""Where a person places several points in a structure who does not look at the result in between: deep inside, far apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from Benchmarks.shared.regions import Voxel, depth_mm, voxel_at
from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box

APART = 0.5
"""A place that is as deep as this share of its distance from the points before is as good as one farther away."""


def deep_points(structure: np.ndarray, spacing_mm: Sequence[float], count: int) -> list[Voxel]:
    """The deepest voxel of a structure, and then, one by one, deep ones that are not near those before.

    Each is where the lesser of two is largest: the depth, and `APART` times the distance from the nearest point before it.

    Args:
        structure: (K, J, I) bool, not empty.
        spacing_mm: of the voxels, along (K, J, I).
        count: how many; more than the structure has voxels repeat some.
    """
    box = bounding_box(structure)
    assert box is not None
    score = depth_mm(structure[box], spacing_mm)
    places_mm = np.ogrid[tuple(slice(0, size) for size in score.shape)]
    start = np.array([side.start for side in box])
    found: list[Voxel] = []
    for _ in range(count):
        deepest = voxel_at(int(score.argmax()), score.shape)
        k, j, i = (int(index) for index in start + deepest)
        found.append((k, j, i))
        squared = sum(
            ((places - index) * step) ** 2 for places, index, step in zip(places_mm, deepest, spacing_mm, strict=True)
        )
        score = np.minimum(score, APART * np.sqrt(squared))
    return found
