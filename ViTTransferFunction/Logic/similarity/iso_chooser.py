"""Chooses the iso values of classes' maps: gathers what the functions of `iso_value` choose them from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from ..core.classes.class_request import ClassRequest, different_places
from ..core.classes.iso_proposals import IsoProposals
from ..core.system.progress import Between, nothing_between
from ..core.volumes.geometry import Geometry
from ..core.volumes.orientation import canonical_orientation
from ..core.volumes.resampling import FixedPlaces, sample_at
from ..core.volumes.voxel_map import VoxelMap
from .cell_intensities import CellIntensities
from .iso_value import (
    STABILITY_SAMPLES,
    Components,
    choose_iso_by_edges,
    choose_refined_iso,
    prior_iso,
    proposals_around,
    raised_prior,
    refined_prior,
)
from .similarity_map import SimilarityMap

AROUND_CELLS = 2 / 3
"""A negative point is evidence about the whole structure only if the map is high in its own cell and at this distance from the
point, in cells, along each axis. The distance is less than a cell, so that only the nearer neighbours count."""


class IsoChooser:
    """Chooses the iso values of maps of one volume by the classes' points and the volume's intensities.

    Args:
        intensities: intensities of the volume on the cells of the maps.
        volume_geometry: the grid of the volume's voxels.
    """

    def __init__(self, intensities: CellIntensities, volume_geometry: Geometry) -> None:
        self._intensities = intensities
        self._volume_geometry = volume_geometry

    def prior(self, request: ClassRequest, without_negatives: Callable[[np.ndarray], np.ndarray]) -> float:
        """The prior of a class's iso value, in (0, 1), from its points.

        Args:
            request: the class, with at least one positive point.
            without_negatives: returns what the class's map would be without negative points, at cells: from their indices (n,)
                to values (n,). Called only if the class has negative points.
        """
        count = _different_positives(request)
        prior = prior_iso(count)
        if not len(request.negative):
            return prior
        around = self._cells_around(np.unique(request.negative, axis=0))
        lowest = without_negatives(around.ravel()).reshape(around.shape).min(axis=1)
        return raised_prior(prior, np.clip(lowest, 0.0, 1.0), count)

    def iso(self, coarse: SimilarityMap, requests: Sequence[ClassRequest], index: int) -> IsoProposals:
        """See `SimilarityRule.iso`; the map must have a prior."""
        assert coarse.prior is not None
        at_positives = self._coarse_at(coarse, requests[index].positive)
        similarity = coarse.array.ravel()[self._intensities.iso_cells]
        components = self._components(requests, index)
        iso = choose_iso_by_edges(similarity, self._intensities.edge_strength, at_positives, coarse.prior, components)
        return proposals_around(iso, at_positives)

    def refined_iso(
        self,
        similarity: VoxelMap,
        coarse: SimilarityMap,
        requests: Sequence[ClassRequest],
        index: int,
        between: Between = nothing_between,
    ) -> IsoProposals:
        """See `SimilarityRule.refined_iso`; the coarse map must have a prior."""
        assert coarse.prior is not None
        positive = requests[index].positive
        at_positives = similarity.at(self._volume_geometry, positive)
        prior = refined_prior(coarse.prior, self._coarse_at(coarse, positive), at_positives)
        at_cells = similarity.at_cells(self._intensities.iso_cells, self._iso_cells_in_volume)
        edge_strength = self._intensities.edge_strength
        components = self._components(requests, index)
        spread = similarity.spread(STABILITY_SAMPLES, canonical_orientation(self._volume_geometry))
        iso = choose_refined_iso(spread, at_cells, edge_strength, at_positives, prior, components, between)
        return proposals_around(iso, at_positives)

    def _cells_around(self, points_ras: np.ndarray) -> np.ndarray:
        """Indices of the cells of points (P, 3) and of the places `AROUND_CELLS` from each along the axes, (P, 7)."""
        axes_ras = AROUND_CELLS * self._intensities.cells.ijk_to_ras[:3, :3].T
        steps_ras = np.concatenate([np.zeros((1, 3)), axes_ras, -axes_ras])
        places_ras = (points_ras[:, None] + steps_ras).reshape(-1, 3)
        return self._intensities.cells_at(places_ras).reshape(-1, len(steps_ras))

    def _coarse_at(self, coarse: SimilarityMap, points_ras: np.ndarray) -> np.ndarray:
        """Values of S_L at points (P, 3), (P, 1)."""
        return sample_at(coarse.array[..., None], self._intensities.cells, points_ras)

    def _components(self, requests: Sequence[ClassRequest], index: int) -> Components:
        return Components(self._intensities.components.of_class(requests, index), _different_positives(requests[index]))

    @cached_property
    def _iso_cells_in_volume(self) -> FixedPlaces:
        # Computed at the first refinement, so that the first map does not have to wait for it.
        return FixedPlaces(self._volume_geometry, self._intensities.centres_ras[self._intensities.iso_cells])


def _different_positives(request: ClassRequest) -> int:
    return len(different_places(request.positive))
