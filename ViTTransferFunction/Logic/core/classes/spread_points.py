"""A few points out of many, far from each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def spread_points(points_mm: np.ndarray, first: Sequence[int], most: int, closest_mm: float) -> np.ndarray:
    """Farthest-point sampling: each next point is the one that is farthest from all that were taken before.

    Args:
        points_mm: (N, 2) or (N, 3), N ≥ 1, millimetres along orthogonal axes.
        first: indices of the points to begin with, at least one; they are taken in any case.
        most: how many points are taken at most.
        closest_mm: none of the further points lies nearer than this to one that is taken.

    Returns:
        (M,) indices of the points taken, in that order.
    """
    taken = list(first)
    distances = np.min([np.linalg.norm(points_mm - points_mm[index], axis=1) for index in taken], axis=0)
    while len(taken) < most and distances.max() >= closest_mm:
        taken.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points_mm - points_mm[taken[-1]], axis=1))
    return np.array(taken)
