"""One volume being segmented: its features once, then maps and labels whenever the annotations change.

It knows no widgets, no files and no MRML. `opening.open_session` makes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from threading import Lock

import numpy as np

from ..core.class_map import ClassMap
from ..core.class_request import ClassRequest, check_requests
from ..core.geometry import Geometry
from ..core.intensity_window import IntensityWindow, display_window
from ..core.iso_proposals import IsoProposals
from ..core.point_thinning import thinned
from ..core.progress import SEGMENTING, Progress, no_progress
from ..core.stopwatch import Stopwatch
from ..core.volume import Volume
from ..features.feature_volume import FeatureVolume
from ..features.whitening import NormalisedFeatures, normalised_features
from ..refinement.refinement import RefinementMethod, refine
from ..similarity.proximity import proximity
from ..similarity.similarity_rule import SimilarityRule, similarity_rule
from .feature_estimate import FeatureEstimate
from .feature_source import FeatureProvenance, FeatureSource
from .labels import assign_labels, count_labels, keep_annotated_components
from .presets import Preset


@dataclass(frozen=True)
class ClassResult:
    """What became of one class.

    Attributes:
        name: of the class.
        iso: the threshold that was used on the full-resolution map.
        voxels: how many voxels the segment has.
        millilitres: their volume.
    """

    name: str
    iso: float
    voxels: int
    millilitres: float


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Labels of all classes.

    Attributes:
        labels: (K, J, I) uint16, 0 for background, 1 + index of the class elsewhere.
        classes: one entry for each class, in order.
    """

    labels: np.ndarray
    classes: tuple[ClassResult, ...]


class SegmentationSession:
    """Holds a volume, its features, and the settings that stay the same while the user annotates.

    Args:
        volume: what is segmented.
        preset: the way through the method.
        source: where `load_features` gets the features from; None where they come by `use_features` only.

    Attributes:
        watch: seconds spent in each step.
    """

    def __init__(self, volume: Volume, preset: Preset, source: FeatureSource | None = None) -> None:
        self.volume = volume
        self.preset = preset
        self.watch = Stopwatch()
        self._source = source
        self._loaded: tuple[NormalisedFeatures, SimilarityRule] | None = None
        self._computing_maps = Lock()

    def estimate(self) -> FeatureEstimate:
        """What the features will cost; see `FeatureSource.estimate`."""
        return self._the_source.estimate()

    def load_features(self, progress: Progress = no_progress, on_coarse: Callable[[], None] | None = None) -> FeatureProvenance:
        """Get the volume's features, from the cache or by computing them; the slow step, once for a volume.

        Args:
            progress: called with bytes downloaded and slices done.
            on_coarse: called whenever coarser features can be used meanwhile; None: compute the final ones alone.

        Raises:
            InputError: the weights are not to be had or do not fit, or the cache's disk is full.
            Cancelled: by the progress callback; coarser features that there are stay usable.
        """
        source = self._the_source
        with self.watch.step("features"):
            for features in source.features(progress, coarse_first=on_coarse is not None):
                self.use_features(features)
                if on_coarse is not None and not self.provenance.cached:
                    on_coarse()
        return self.provenance

    def use_features(self, features: FeatureVolume) -> None:
        """Take these features of the volume, from wherever they are."""
        normalised = normalised_features(features, self.preset.statistics)
        self._loaded = normalised, similarity_rule(self.preset.similarity, normalised, self.volume)

    @property
    def provenance(self) -> FeatureProvenance:
        """Where the loaded features come from. Raises RuntimeError before `load_features`."""
        if self._source is None or self._source.provenance is None:
            raise RuntimeError("load_features comes first")
        return self._source.provenance

    @property
    def features(self) -> NormalisedFeatures:
        """The volume's features. Raises RuntimeError before `load_features`."""
        return self._features_and_rule[0]

    @property
    def rule(self) -> SimilarityRule:
        """From annotations to maps and thresholds. Raises RuntimeError before `load_features`."""
        return self._features_and_rule[1]

    @property
    def _features_and_rule(self) -> tuple[NormalisedFeatures, SimilarityRule]:
        if self._loaded is None:
            raise RuntimeError("load_features comes first")
        return self._loaded

    @cached_property
    def display_window(self) -> IntensityWindow:
        """The window in which a person would look at the volume; found once, since it takes a look at many voxels."""
        return display_window(self.volume)

    def low_resolution_maps(self, requests: Sequence[ClassRequest]) -> list[ClassMap]:
        """S_L of every class and its threshold: the answer to a click, in milliseconds.

        Any thread may ask, also while another loads finer features or segments.
        """
        # Rules keep from click to click what can be used again.
        requests = thinned(requests, self.volume.geometry)
        with self._computing_maps, self.watch.step("similarity"):
            features, rule = self._features_and_rule
            geometry = features.geometry
            maps = rule.maps(requests)
            for similarity, request in zip(maps, requests, strict=True):
                if request.proximity > 0.0:
                    similarity *= proximity(geometry, request.positive, request.proximity)
            return [
                _class_map(similarity, geometry, request, partial(rule.iso, similarity, requests, index))
                for index, (similarity, request) in enumerate(zip(maps, requests, strict=True))
            ]

    def refined_map(
        self,
        low: ClassMap,
        requests: Sequence[ClassRequest],
        index: int,
        method: RefinementMethod,
        between: Callable[[], None] = lambda: None,
    ) -> ClassMap:
        """S_H of the index-th class from its S_L, sharpened where the class asks for it, and its threshold.

        The threshold is chosen anew, since refinement changes the range of the map. The map is that of the chosen proposal
        whatever the class's size, so that a larger size never makes the structure smaller. `between` is called between steps,
        and may raise `Cancelled`.
        """
        requests = thinned(requests, self.volume.geometry)
        request = requests[index]
        with self.watch.step("refinement"):
            wanted = method if request.refine else "none"
            usual = low.proposals.chosen if low.proposals else low.iso
            similarity = refine(
                low.array, self.volume, self.display_window, request.positive, usual, wanted, between, lowest_iso=low.iso
            )
            between()
            if wanted == "none":
                return ClassMap(similarity, self.volume.geometry, low.iso, low.proposals)
            propose = partial(self.rule.refined_iso, similarity, low.array, requests, index)
            return _class_map(similarity, self.volume.geometry, request, propose)

    def segment(
        self,
        requests: Sequence[ClassRequest],
        method: RefinementMethod = "bilateral",
        only_annotated_components: bool = True,
        progress: Progress = no_progress,
        on_map: Callable[[ClassRequest, ClassMap], None] | None = None,
    ) -> Segmentation:
        """Segment all classes, each voxel going to one class at most.

        Args:
            requests: at least one, of different ids, all points inside the volume.
            method: how maps are refined.
            only_annotated_components: drop the parts of a segment that hold none of its positive points.
            progress: called with classes done.
            on_map: is shown each full-resolution map before the next is made; they are not kept.

        Raises:
            InputError: the requests are not usable.
            Cancelled: by the progress callback.
        """
        check_requests(requests, self.volume.geometry)
        isos: list[float] = []

        def maps() -> Iterator[tuple[np.ndarray, float]]:
            progress(0, len(requests), SEGMENTING)
            telling = thinned(requests, self.volume.geometry)
            low_maps = self.low_resolution_maps(telling)
            for index, request in enumerate(requests):
                # In between as well: a click that comes now should not have to wait long.
                between = partial(progress, index, len(requests), SEGMENTING)
                full = self.refined_map(low_maps[index], telling, index, method, between)
                between()
                if on_map:
                    on_map(request, full)
                isos.append(full.iso)
                yield full.array, full.iso
                progress(index + 1, len(requests), SEGMENTING)

        labels = self._labels(maps(), self.volume.geometry, requests, only_annotated_components)
        return Segmentation(labels, tuple(self._results(requests, isos, labels)))

    def low_resolution_volumes_ml(
        self, requests: Sequence[ClassRequest], low_maps: Sequence[ClassMap], only_annotated_components: bool = True
    ) -> tuple[float, ...]:
        """How large each class's segment will be, millilitres, to the size of a cell: its S_L, segmented as `segment` does."""
        maps = ((low.array, low.iso) for low in low_maps)
        geometry = self.features.geometry
        labels = self._labels(maps, geometry, requests, only_annotated_components)
        return tuple(cells * _voxel_ml(geometry) for cells in count_labels(labels, len(requests)))

    def _labels(
        self,
        maps: Iterable[tuple[np.ndarray, float]],
        geometry: Geometry,
        requests: Sequence[ClassRequest],
        only_annotated_components: bool,
    ) -> np.ndarray:
        """Labels (K, J, I) uint16 on `geometry` from the classes' maps on it and their thresholds."""
        labels = assign_labels(maps, geometry.shape)
        with self.watch.step("components"):
            if only_annotated_components:
                for label, request in enumerate(requests, start=1):
                    keep_annotated_components(labels, label, geometry, request.positive)
        return labels

    @property
    def _the_source(self) -> FeatureSource:
        if self._source is None:
            raise RuntimeError("this session has no source of features; give it some by use_features")
        return self._source

    def _results(self, requests: Sequence[ClassRequest], isos: list[float], labels: np.ndarray) -> Iterator[ClassResult]:
        voxel_ml = _voxel_ml(self.volume.geometry)
        for request, iso, count in zip(requests, isos, count_labels(labels, len(requests)), strict=True):
            yield ClassResult(request.name, iso, count, count * voxel_ml)


def _class_map(
    similarity: np.ndarray, geometry: Geometry, request: ClassRequest, propose: Callable[[], IsoProposals]
) -> ClassMap:
    """A map with the iso value that the user fixed, or else with the one of the size that the user chose."""
    if request.iso is not None:
        return ClassMap(similarity, geometry, request.iso)
    proposals = propose()
    return ClassMap(similarity, geometry, proposals.chosen, proposals).resized(request)


def _voxel_ml(geometry: Geometry) -> float:
    return geometry.voxel_volume_mm3 / 1000.0
