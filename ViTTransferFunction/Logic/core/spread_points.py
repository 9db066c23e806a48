"""A few points out of many, far from each other."""

from __future__ import annotations

import numpy as np


def spread_points(points_mm: np.ndarray, first: int, most: int, closest_mm: float) -> np.ndarray:
    """Farthest-point sampling: each next point is the one that is farthest from all that were taken before.

    Args:
        points_mm: (N, 2) or (N, 3), N ≥ 1, millimetres along orthogonal axes.
        first: index of the point to begin with.
        most: how many points are taken at most.
        closest_mm: no two points that are taken lie nearer than this.

    Returns:
        (M,) indices of the points taken, 1 ≤ M ≤ `most`, in that order.
    """
    taken = [first]
    distances = np.linalg.norm(points_mm - points_mm[first], axis=1)
    while len(taken) < most and distances.max() >= closest_mm:
        taken.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points_mm - points_mm[taken[-1]], axis=1))
    return np.array(taken)
