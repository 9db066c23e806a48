"""How much a map fades with distance from the annotated points (paper §III-B)."""

from __future__ import annotations

import numpy as np

from ..core.volumes.geometry import Geometry


def proximity(geometry: Geometry, points_ras: np.ndarray, strength: float, longest_edge_mm: float) -> np.ndarray:
    """The paper's proximity, P(x) = max_a exp(−10 p̃ |x − a|).

    Distances are taken in millimetres and divided by the volume's longest edge: the paper's normalised unit, without its
    dependence on how the volume is sampled.

    Args:
        geometry: of the cells.
        points_ras: (N, 3) RAS millimetres, N ≥ 1.
        strength: p̃ in [0, 1]; 0 gives 1 everywhere.
        longest_edge_mm: of the volume, or of that of which it is a part.

    Returns:
        (K', J', I') float32 in (0, 1].
    """
    distance_mm = np.sqrt(_smallest_squared_distance(geometry, points_ras))
    fading: np.ndarray = np.exp(-10.0 * strength * distance_mm / longest_edge_mm).astype(np.float32)
    return fading


def _smallest_squared_distance(geometry: Geometry, points_ras: np.ndarray) -> np.ndarray:
    """Squared distance (K', J', I') from each cell's centre to the nearest point, mm²."""
    axes = [np.arange(count, dtype=np.float64) for count in geometry.shape]
    k, j, i = np.meshgrid(*axes, indexing="ij", sparse=True)
    matrix = geometry.ijk_to_ras
    smallest = np.full(geometry.shape, np.inf)
    for point in points_ras:
        squared = sum(
            (matrix[row, 0] * i + matrix[row, 1] * j + matrix[row, 2] * k + (matrix[row, 3] - point[row])) ** 2
            for row in range(3)
        )
        np.minimum(smallest, squared, out=smallest)
    return smallest
