"""Segments one volume: computes its features once, then maps and labels whenever the annotations change.

The session knows no widgets, no files and no MRML. `opening.open_session` makes it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from threading import Lock

import numpy as np

from ..core.classes.class_map import ClassMap
from ..core.classes.class_request import ClassRequest, check_requests, points_against
from ..core.classes.iso_proposals import IsoProposals
from ..core.system.progress import SEGMENTING, Between, Progress, no_progress, nothing_between
from ..core.system.stopwatch import Stopwatch
from ..core.volumes.bounding_box import bounding_box
from ..core.volumes.geometry import Geometry
from ..core.volumes.intensity_window import IntensityWindow, display_window
from ..core.volumes.label_dtype import label_dtype
from ..core.volumes.volume import Volume
from ..features.feature_volume import FeatureVolume
from ..features.whitening import NormalisedFeatures, normalised_features
from ..refinement.refinement import RefinementMethod, held_voxels, refine
from ..refinement.settling import settle
from ..similarity.proximity import proximity
from ..similarity.similarity_map import SimilarityMap
from ..similarity.similarity_rule import NEEDS_INTENSITIES, SimilarityRule, similarity_rule
from .close_ups import CloseUps, Part, PartSession
from .feature_estimate import FeatureEstimate
from .feature_source import FeatureProvenance, FeatureSource
from .labels import Competition, keep_annotated_components
from .loaded_features import LoadedFeatures, SharedIntensities
from .memory_need import check_memory_for_refinement
from .point_thinning import thinned
from .presets import Preset
from .refined_map import RefinedMap
from .segmentation import Segmentation, label_sizes, segmentation_of

_Asked = tuple[tuple[ClassRequest, Part | None], ...]
"""Classes, and the parts in which they are looked at."""


class SegmentationSession:
    """Holds a volume, its features, and the settings that stay the same while the user annotates.

    Args:
        volume: the volume to segment.
        preset: the settings of all steps of the method.
        source: where `load_features` gets the features from; None if they are set by `use_features` only.
        open_part: makes a session on a part of the volume; None: there are no close-ups.

    Attributes:
        watch: seconds spent in each step.
    """

    def __init__(
        self,
        volume: Volume,
        preset: Preset,
        source: FeatureSource | None = None,
        open_part: Callable[[Volume], PartSession] | None = None,
    ) -> None:
        self.volume = volume
        self.preset = preset
        self.watch = Stopwatch()
        self._source = source
        self._loaded: LoadedFeatures | None = None
        self._intensities = SharedIntensities(volume)
        self._computing_maps = Lock()
        self._close_ups = CloseUps(volume, open_part)
        self._answered: tuple[SimilarityRule, _Asked, list[ClassMap]] | None = None

    def estimate(self, coarse_first: bool = False) -> FeatureEstimate:
        """What the features will cost; see `FeatureSource.estimate`."""
        return self._the_source.estimate(coarse_first)

    def load_features(self, progress: Progress = no_progress, on_coarse: Callable[[], None] | None = None) -> FeatureProvenance:
        """Get the volume's features, from the cache or by computing them; the slow step, once for a volume.

        Args:
            progress: called with bytes downloaded and slices done.
            on_coarse: called whenever coarse or finer features can be used; None: only the final ones are computed.

        Raises:
            InputError: the weights or the device are not available, the weights do not fit the model, or memory is not
                enough.
            Cancelled: by the progress callback; coarse features that are there already can still be used.
        """
        source = self._the_source
        with self.watch.step("features"):
            for features in source.features(progress, coarse_first=on_coarse is not None):
                self._use(features)
                if on_coarse is not None and not self.provenance.cached:
                    on_coarse()
        return self.provenance

    def use_features(self, features: FeatureVolume) -> None:
        """Use these features of the volume, which need not come from `load_features`."""
        self._use(normalised_features(features, self.preset.statistics))

    def prepare_clicks(self) -> None:
        """Compute in advance what the first click would wait for; before there are features, the part that does not need them.

        Any thread may call this, also while another one loads the features.
        """
        if self._loaded is not None:
            _ = self._loaded.rule
        elif self.preset.similarity in NEEDS_INTENSITIES:
            self._intensities.on(self._the_source.cells)

    def awaiting_close_ups(self, requests: Sequence[ClassRequest]) -> tuple[str, ...]:
        """Ids of the classes whose close-ups are not loaded yet: until `look_closer`, the whole volume is used for them."""
        return tuple(request.id for request in self._close_ups.missing(thinned(requests, self.volume.geometry)))

    def look_closer(self, requests: Sequence[ClassRequest], progress: Progress = no_progress) -> None:
        """Load the features of all classes' close-ups, from the cache or by computing them.

        Any thread may ask for maps meanwhile. See `load_features` for `progress` and what is raised.
        """
        with self.watch.step("close-ups"):
            self._close_ups.load(thinned(requests, self.volume.geometry), progress)

    @property
    def provenance(self) -> FeatureProvenance:
        """Where the loaded features come from. Raises RuntimeError before `load_features`."""
        if self._source is None or self._source.provenance is None:
            raise RuntimeError("load_features comes first")
        return self._source.provenance

    @property
    def not_kept(self) -> str:
        """Why features of the volume or of a close-up could not be stored in the cache, a sentence for the user; "" if all are.

        Raises RuntimeError before `load_features`.
        """
        return self.provenance.not_kept or self._close_ups.not_kept

    @property
    def features(self) -> NormalisedFeatures:
        """The volume's features. Raises RuntimeError before `load_features`."""
        return self._the_loaded.features

    @property
    def rule(self) -> SimilarityRule:
        """From annotations to maps and thresholds. Raises RuntimeError before `load_features`."""
        return self._the_loaded.rule

    @cached_property
    def display_window(self) -> IntensityWindow:
        """The window in which a person would look at the volume; found once, since many voxels are read for it."""
        return display_window(self.volume)

    def low_resolution_maps(
        self,
        requests: Sequence[ClassRequest],
        between: Between = nothing_between,
        first: str = "",
        on_first: Callable[[ClassMap], None] = lambda first: None,
    ) -> list[ClassMap]:
        """S_L of every class and its threshold: the answer to a click, in milliseconds.

        Any thread may ask, also while another loads finer features or segments.

        Args:
            requests: the classes.
            between: called before the computation for each new point; may raise `Cancelled`. What is computed by then is kept.
            first: id of a class whose map is wanted before the others; "": none.
            on_first: called with this map as soon as it is there.

        Returns:
            The maps. They must not be changed, because the next call with the same requests, as a refinement makes, returns
            the same ones.
        """
        # One at a time, since rules keep results from click to click.
        requests = thinned(requests, self.volume.geometry)
        with self._computing_maps, self.watch.step("similarity"):
            loaded = self._the_loaded
            parts = [self._close_ups.of(request) for request in requests]
            asked = tuple(zip(requests, parts, strict=True))
            if self._answered is None or self._answered[0] is not loaded.rule or self._answered[1] != asked:
                maps = self._class_maps(loaded, requests, parts, between, first, on_first)
                self._answered = loaded.rule, asked, maps
            return list(self._answered[2])

    def refined_map(
        self,
        low: ClassMap,
        requests: Sequence[ClassRequest],
        index: int,
        method: RefinementMethod,
        between: Between = nothing_between,
    ) -> RefinedMap:
        """S_H of the index-th class from its S_L, sharpened where the class asks for it, and its threshold.

        The threshold is chosen again, since refinement changes the range of the map. The map is always refined for the chosen
        proposal, whatever the class's size: a smaller size is a higher threshold of the same map. For a larger size, voxels
        farther out are refined as well, which changes the others slightly, so that the structure may lose a few voxels of its
        surface while it grows. `between` is called between steps, and may raise `Cancelled`.
        """
        requests = thinned(requests, self.volume.geometry)
        request = requests[index]
        part = self._close_ups.of(request)
        with self.watch.step("refinement"):
            if part is not None:
                return part.refined_map(self.volume.shape, requests, index, method, between)
            wanted, usual = _refinement(low, request, method)
            seen = self.rule.seen(requests)
            looks = seen[index].positive
            voxels = refine(low.array, self.volume, self.display_window, looks, usual, wanted, between, lowest_iso=low.iso)
            between()
            if wanted == "none":
                return RefinedMap(voxels, low.iso)
            iso = usual_iso = low.iso
            if request.iso is None:
                proposals = self.rule.refined_iso(voxels, SimilarityMap(low.array, low.prior), seen, index, between)
                iso, usual_iso = proposals.at(request.size), proposals.chosen
            against = points_against(requests, index)
            voxels = settle(voxels, self.volume, self.display_window, request.positive, against, usual_iso, between)
            return RefinedMap(voxels, iso)

    def segment(
        self,
        requests: Sequence[ClassRequest],
        method: RefinementMethod = "bilateral",
        only_annotated_components: bool = True,
        progress: Progress = no_progress,
        on_map: Callable[[ClassRequest, RefinedMap], None] | None = None,
    ) -> Segmentation:
        """Segment all classes; each voxel belongs to one class at most.

        Call `look_closer` before: the whole volume is used for classes whose close-ups are not loaded.

        Args:
            requests: at least one, with different ids, and all points inside the volume.
            method: how maps are refined.
            only_annotated_components: drop the parts of a segment that contain none of its positive points.
            progress: called with the number of classes done.
            on_map: called with each full-resolution map before the next is computed; maps are not kept.

        Raises:
            InputError: the requests are not usable, or memory is not enough.
            Cancelled: by the progress callback.
        """
        check_requests(requests, self.volume.geometry)
        progress(0, len(requests), SEGMENTING)
        thresholds = []
        telling = thinned(requests, self.volume.geometry)
        low_maps = self.low_resolution_maps(telling, partial(progress, 0, len(requests), SEGMENTING))
        dtype = label_dtype(len(requests))
        self._check_memory(requests, low_maps, method, np.dtype(dtype).itemsize)
        competition = Competition(self.volume.shape, dtype)
        for index, request in enumerate(requests):
            # Called between steps as well, so that a click does not have to wait long.
            between = partial(progress, index, len(requests), SEGMENTING)
            full = self.refined_map(low_maps[index], telling, index, method, between)
            between()
            if on_map:
                on_map(request, full)
            box = full.voxels.box_above(full.iso)
            reaches_iso = competition.enter(full.voxels.part(box) if box else None, full.iso, box)
            thresholds.append((full.iso, reaches_iso))
            # Frees the map before the next one is computed.
            del full
            progress(index + 1, len(requests), SEGMENTING)
        labels, geometry = competition.labels, self.volume.geometry
        between = partial(progress, len(requests), len(requests), SEGMENTING)
        self._drop_unannotated_components(labels, geometry, requests, only_annotated_components, between)
        return segmentation_of(labels, geometry, requests, thresholds)

    def low_resolution_volumes_ml(
        self, requests: Sequence[ClassRequest], low_maps: Sequence[ClassMap], only_annotated_components: bool = True
    ) -> tuple[float, ...]:
        """The volume of each class's segment in millilitres, estimated on the cells: S_L, segmented as `segment` does."""
        geometry = self.features.geometry
        competition = Competition(geometry.shape, np.uint16)
        for low in low_maps:
            box = bounding_box(low.array >= low.iso)
            competition.enter(low.array[box] if box else None, low.iso, box)
        self._drop_unannotated_components(competition.labels, geometry, requests, only_annotated_components)
        return tuple(millilitres for _, millilitres in label_sizes(competition.labels, geometry, len(requests)))

    def _use(self, normalised: NormalisedFeatures) -> None:
        self._loaded = LoadedFeatures(
            normalised, partial(similarity_rule, self.preset.similarity, normalised, self.volume, self._intensities.on)
        )

    @property
    def _the_source(self) -> FeatureSource:
        if self._source is None:
            raise RuntimeError("this session has no source of features; give it some by use_features")
        return self._source

    @property
    def _the_loaded(self) -> LoadedFeatures:
        if self._loaded is None:
            raise RuntimeError("load_features comes first")
        return self._loaded

    def _class_maps(
        self,
        loaded: LoadedFeatures,
        requests: Sequence[ClassRequest],
        parts: Sequence[Part | None],
        between: Between,
        first: str,
        on_first: Callable[[ClassMap], None],
    ) -> list[ClassMap]:
        """See `low_resolution_maps`. `parts` has the part in which each class is looked at, or None for the whole volume."""
        rule, geometry = loaded.rule, loaded.features.geometry
        seen = rule.seen(requests)
        found: dict[int, ClassMap] = {}
        sooner = next((index for index, request in enumerate(requests) if request.id == first), None)
        for index, coarse in rule.maps(seen, between, sooner):
            request, part = requests[index], parts[index]
            if part is not None:
                found[index] = part.map_on(geometry, requests, index, between)
            else:
                if request.proximity > 0.0:
                    faded = proximity(geometry, request.positive, request.proximity, self.volume.longest_edge_mm)
                    np.multiply(coarse.array, faded, out=coarse.array)
                found[index] = _class_map(coarse, geometry, request, partial(rule.iso, coarse, seen, index))
            if index == sooner:
                on_first(found[index])
        return [found[index] for index in range(len(requests))]

    def _check_memory(
        self, requests: Sequence[ClassRequest], low_maps: Sequence[ClassMap], method: RefinementMethod, bytes_per_label: int
    ) -> None:
        held = []
        for low, request in zip(low_maps, requests, strict=True):
            wanted, usual = _refinement(low, request, method)
            held.append(held_voxels(low.array, self.volume.shape, usual, wanted, low.iso))
        check_memory_for_refinement(self.volume, held, bytes_per_label)

    def _drop_unannotated_components(
        self,
        labels: np.ndarray,
        geometry: Geometry,
        requests: Sequence[ClassRequest],
        only_annotated_components: bool,
        between: Between = nothing_between,
    ) -> None:
        with self.watch.step("components"):
            if only_annotated_components:
                points = {label: request.positive for label, request in enumerate(requests, start=1)}
                keep_annotated_components(labels, geometry, points, between)


def _class_map(
    coarse: SimilarityMap, geometry: Geometry, request: ClassRequest, propose: Callable[[], IsoProposals]
) -> ClassMap:
    """A map with the iso value that the user set, else with the proposed one for the class's size."""
    if request.iso is not None:
        return ClassMap(coarse.array, geometry, request.iso)
    proposals = propose()
    return ClassMap(coarse.array, geometry, proposals.chosen, proposals, coarse.prior).resized(request)


def _refinement(low: ClassMap, request: ClassRequest, method: RefinementMethod) -> tuple[RefinementMethod, float]:
    """The method to refine a class's map by, and the iso value to refine it for: that of the chosen proposal."""
    return method if request.refine else "none", low.proposals.chosen if low.proposals else low.iso
