"""The ways from annotations to low-resolution maps S_L and their thresholds (paper §III-B), behind one interface."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal, Protocol

from ..core.classes.class_request import ClassRequest
from ..core.classes.iso_proposals import IsoProposals
from ..core.system.progress import Between, nothing_between
from ..core.volumes.geometry import Geometry
from ..core.volumes.volume import Volume
from ..core.volumes.voxel_map import VoxelMap
from ..features.whitening import NormalisedFeatures
from .cell_intensities import CellIntensities
from .cosine import CosineSimilarity, mean_clamped_cosine, mean_cosine
from .kernel_ridge import KernelRidge
from .similarity_map import SimilarityMap

SimilarityMethod = Literal["kernel ridge", "cosine", "clamped cosine"]
"""Learned from all classes' points (`kernel_ridge`); the mean cosine of Eq. 1; the variant of it in the authors' program."""

NEEDS_INTENSITIES: frozenset[SimilarityMethod] = frozenset({"kernel ridge"})
"""Those that look at intensities as well, before the first click."""


class SimilarityRule(Protocol):
    """Maps of classes on one volume; what does not change between clicks is computed once, when it is made."""

    def seen(self, requests: Sequence[ClassRequest]) -> list[ClassRequest]:
        """The same classes, with their points where they are best looked at: what all else is to be given."""

    def maps(
        self, requests: Sequence[ClassRequest], between: Between = nothing_between, first: int | None = None
    ) -> Iterator[tuple[int, SimilarityMap]]:
        """S_L of all classes; the caller may change the arrays.

        Args:
            requests: the classes.
            between: called before what is computed for each new point; may raise `Cancelled`.
            first: index of a class whose map is wanted sooner than the others.

        Yields:
            Index and map of each class, the first one first where that is sooner.
        """

    def iso(self, coarse: SimilarityMap, requests: Sequence[ClassRequest], index: int) -> IsoProposals:
        """The thresholds that the index-th class's S_L may have."""

    def refined_iso(
        self,
        similarity: VoxelMap,
        coarse: SimilarityMap,
        requests: Sequence[ClassRequest],
        index: int,
        between: Between = nothing_between,
    ) -> IsoProposals:
        """The thresholds that the index-th class's S_H (K, J, I) may have, made on the voxels from its `coarse` S_L.

        `between` is called between short steps; it may raise `Cancelled`.
        """


def similarity_rule(
    method: SimilarityMethod,
    features: NormalisedFeatures,
    volume: Volume,
    intensities: Callable[[Geometry], CellIntensities],
) -> SimilarityRule:
    """The rule of that name for a volume.

    Args:
        method: which one.
        features: of the volume's cells.
        volume: the intensities.
        intensities: looks at the volume's intensities on cells, or has done so before.
    """
    if method == "kernel ridge":
        return KernelRidge(features, volume, intensities(features.geometry))
    return CosineSimilarity(features, volume.geometry, mean_cosine if method == "cosine" else mean_clamped_cosine)
