"""Similarity as the mean cosine with the annotated features: Eq. 1 of the paper, and what the authors' program makes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ..core.classes.class_request import ClassRequest, points_against
from ..core.classes.iso_proposals import IsoProposals
from ..core.system.progress import Between, nothing_between
from ..core.volumes.geometry import Geometry
from ..core.volumes.resampling import sample_at
from ..core.volumes.voxel_map import VoxelMap
from ..features.whitening import NormalisedFeatures
from .iso_value import iso_between_points, proposals_around
from .similarity_map import SimilarityMap

LOWEST_COUNTED_COSINE = 0.25
CLAMPED_EXPONENT = 2.5

Average = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From cells (K', J', I', C) and queries (N, C), unit vectors, to the similarity (K', J', I') of each cell with the queries."""


class CosineSimilarity:
    """Each class by itself: how similar cells are to its own points. A `SimilarityRule`.

    Negative points, which the paper names as future work, count as the positive ones do but with the opposite sign.

    Args:
        features: of the volume's cells.
        volume_geometry: of the volume's voxels, on which refined maps lie.
        average: `mean_cosine` (Eq. 1) or `mean_clamped_cosine` (the authors' program).
    """

    def __init__(self, features: NormalisedFeatures, volume_geometry: Geometry, average: Average) -> None:
        self._features = features
        self._volume_geometry = volume_geometry
        self._average = average

    def seen(self, requests: Sequence[ClassRequest]) -> list[ClassRequest]:
        """See `SimilarityRule`: where they are."""
        return list(requests)

    def maps(
        self, requests: Sequence[ClassRequest], between: Between = nothing_between, first: int | None = None
    ) -> Iterator[tuple[int, SimilarityMap]]:
        """See `SimilarityRule`."""
        for index in sorted(range(len(requests)), key=lambda index: index != first):
            yield index, SimilarityMap(self._map(requests[index]))

    def iso(self, coarse: SimilarityMap, requests: Sequence[ClassRequest], index: int) -> IsoProposals:
        """See `SimilarityRule`."""
        return _iso(lambda points: sample_at(coarse.array[..., None], self._features.geometry, points), requests, index)

    def refined_iso(
        self,
        similarity: VoxelMap,
        coarse: SimilarityMap,
        requests: Sequence[ClassRequest],
        index: int,
        between: Between = nothing_between,
    ) -> IsoProposals:
        """See `SimilarityRule`."""
        return _iso(lambda points: similarity.at(self._volume_geometry, points), requests, index)

    def _map(self, request: ClassRequest) -> np.ndarray:
        similarity = self._average(self._features.array, self._features.at(request.positive))
        if len(request.negative):
            similarity = similarity - self._average(self._features.array, self._features.at(request.negative))
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
    similarity: np.ndarray = cells @ queries.mean(axis=0)
    return similarity


def mean_clamped_cosine(cells: np.ndarray, queries: np.ndarray) -> np.ndarray:
    """As `mean_cosine`, but each cosine below 0.25 counts as 0 and the others are raised to the power 2.5; in [0, 1]."""
    total = np.zeros(cells.shape[:3], dtype=np.float32)
    for query in queries:
        cosine = cells @ query
        total += np.where(cosine >= LOWEST_COUNTED_COSINE, cosine, 0.0) ** CLAMPED_EXPONENT
    return total / len(queries)


def _iso(sample: Callable[[np.ndarray], np.ndarray], requests: Sequence[ClassRequest], index: int) -> IsoProposals:
    """The threshold between a class's map at its positive points, and at its negative and all points of other classes alone.

    Args:
        sample: from world points (N, 3) to the map there, (N, …).
        requests: all classes.
        index: of the class.
    """
    at_positives, at_negatives = sample(requests[index].positive), sample(points_against(requests, index))
    return proposals_around(iso_between_points(at_positives, at_negatives), at_positives)
