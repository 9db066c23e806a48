"""From annotations to low-resolution similarity maps S_L (paper §III-B)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from ..core.annotations import AnnotatedClass
from ..core.geometry import Geometry
from ..features.whitening import ComparableFeatures

SimilarityMethod = Literal["kernel", "cosine", "published"]
"""How annotations become maps: learned from all classes' points (`kernel_similarity`), by the mean cosine of Eq. 1, or by the
variant of it that the authors' program computes."""

PUBLISHED_LOWER_BOUND = 0.25
PUBLISHED_EXPONENT = 2.5


def mean_similarity_map(
    features: ComparableFeatures, annotated: AnnotatedClass, average: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """How similar each cell is to a class's points.

    Negative points, which the paper names as future work, count as the positive ones do but with the opposite sign.

    Args:
        features: comparable features of the volume.
        annotated: the class with its points.
        average: `mean_cosine` (Eq. 1) or `mean_published_similarity` (what the authors' program computes).

    Returns:
        S_L, (K', J', I') float32 in [0, 1].
    """
    similarity = average(features.array, features.at(annotated.positive))
    if len(annotated.negative):
        similarity = similarity - average(features.array, features.at(annotated.negative))
    return np.clip(similarity, 0.0, 1.0).astype(np.float32)


def mean_cosine(cells: np.ndarray, queries: np.ndarray) -> np.ndarray:
    """Mean over the queries of their cosine with each cell: Eq. 1 before its clamp at 0.

    The mean of dot products is the dot product with the mean, so the cost does not grow with the number of queries.

    Args:
        cells: (K', J', I', C) unit vectors.
        queries: (N, C) unit vectors, N ≥ 1.

    Returns:
        (K', J', I') in [-1, 1].
    """
    return cells @ queries.mean(axis=0)


def mean_published_similarity(cells: np.ndarray, queries: np.ndarray) -> np.ndarray:
    """As `mean_cosine`, but each cosine below 0.25 counts as 0 and the others are raised to the power 2.5; in [0, 1]."""
    total = np.zeros(cells.shape[:3], dtype=np.float32)
    for query in queries:
        cosine = cells @ query
        total += np.where(cosine >= PUBLISHED_LOWER_BOUND, cosine, 0.0) ** PUBLISHED_EXPONENT
    return total / len(queries)


def proximity(geometry: Geometry, points_ras: np.ndarray, strength: float) -> np.ndarray:
    """The paper's proximity, P(x) = max_a exp(−10 p̃ |x − a|).

    Distances are taken in millimetres and divided by the volume's longest edge: the paper's normalised unit, without its
    dependence on how the volume is sampled.

    Args:
        geometry: of the cells.
        points_ras: (N, 3) RAS millimetres, N ≥ 1.
        strength: p̃ in [0, 1]; 0 gives 1 everywhere.

    Returns:
        (K', J', I') float32 in (0, 1].
    """
    distance_mm = np.sqrt(_smallest_squared_distance(geometry, points_ras))
    return np.exp(-10.0 * strength * distance_mm / geometry.extent_mm.max()).astype(np.float32)


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
