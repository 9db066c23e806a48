"""One volume being segmented: its features once, then maps and labels whenever the annotations change.

This is the object that front ends talk to. It knows no widgets, no files and no MRML.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from Benchmarks.hints.click_hint import click_hint

from ..core.annotations import AnnotatedClass, check_classes
from ..core.geometry import Geometry
from ..core.intensity_window import IntensityWindow, display_window
from ..core.progress import Progress, no_progress
from ..core.stopwatch import Stopwatch
from ..core.volume import Volume
from ..features.cache import FeatureCache
from ..features.extraction import extract_features, features_size_bytes
from ..features.feature_volume import FeatureVolume, sample_at
from ..features.progressive import progressive_features
from ..features.settings import FeatureSettings, feature_key
from ..features.whitening import ComparableFeatures, comparable_features
from ..refinement.refinement import RefinementMethod, refine
from ..similarity.cosine import mean_cosine, mean_published_similarity, mean_similarity_map, proximity
from ..similarity.kernel_ridge import KernelSimilarity
from .labels import choose_iso, compete, keep_annotated_components
from .presets import Preset

if TYPE_CHECKING:
    import torch

    from ..features.vision_transformer import VisionTransformer
    from ..weights.sources import WeightsFile


@dataclass(frozen=True, eq=False)
class ClassMap:
    """A class's map at one resolution.

    Attributes:
        similarity: S_L (K', J', I') or S_H (K, J, I), float32 in [0, 1].
        iso: the threshold that selects the class.
    """

    similarity: np.ndarray
    iso: float


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


@dataclass(frozen=True)
class FeatureProvenance:
    """Where features come from.

    Attributes:
        weights: what they were computed with.
        device: what they were computed on, or would have been.
        cached: whether they were found in the cache.
    """

    weights: WeightsFile
    device: str
    cached: bool


class SegmentationSession:
    """Holds a volume, its features, and the settings that stay the same while the user annotates.

    Args:
        volume: what is segmented.
        preset: the way through the method.
        feature_settings: replaces the preset's (another grid, say).
        cache: where features are kept between sessions; None: nowhere.

    Attributes:
        provenance: where the loaded features come from; None before `load_features`.
        watch: seconds spent in each step.
    """

    def __init__(
        self,
        volume: Volume,
        preset: Preset,
        feature_settings: FeatureSettings | None = None,
        cache: FeatureCache | None = None,
    ) -> None:
        self.volume = volume
        self.preset = preset
        self.feature_settings = feature_settings or preset.features
        self.cache = cache
        self.watch = Stopwatch()
        self._features: ComparableFeatures | None = None
        self._kernel_similarity: KernelSimilarity | None = None
        self.provenance: FeatureProvenance | None = None

    def load_features(
        self,
        weights: WeightsFile,
        device: torch.device,
        progress: Progress = no_progress,
        on_coarse: Callable[[], None] | None = None,
    ) -> FeatureProvenance:
        """Get the volume's features, from the cache or by computing them; the slow step, once for a volume.

        Args:
            weights: of the model.
            device: to compute on.
            progress: told of slices done.
            on_coarse: called whenever coarser features can be used meanwhile; None: compute the final ones alone.

        Raises:
            InputError: the weights do not fit, or the cache's disk is full.
            Cancelled: by the progress callback; coarser features that there are stay usable.
        """
        with self.watch.step("features"):
            key = feature_key(self.volume, weights.model.name, weights.sha256, self.feature_settings)
            cached = self.cache.get(key) if self.cache else None
            if cached is not None:
                self.use_features(cached)
            else:
                self._extract(weights, device, progress, on_coarse)
        self.provenance = FeatureProvenance(weights, str(device), cached is not None)
        return self.provenance

    def use_features(self, features: FeatureVolume) -> None:
        """Take these features of the volume, from wherever they are."""
        self._features = comparable_features(features, self.preset.statistics)
        if self.preset.similarity == "kernel":
            self._kernel_similarity = KernelSimilarity(self._features, self.volume)

    @property
    def has_features(self) -> bool:
        """Whether there are features, be they coarse."""
        return self._features is not None

    @property
    def features(self) -> ComparableFeatures:
        """The volume's features. Raises RuntimeError before `load_features`."""
        if self._features is None:
            raise RuntimeError("load_features comes first")
        return self._features

    @cached_property
    def display_window(self) -> IntensityWindow:
        """The window in which a person would look at the volume; found once, since it takes a look at many voxels."""
        return display_window(self.volume)

    def low_resolution_maps(self, classes: Sequence[AnnotatedClass]) -> list[ClassMap]:
        """S_L of every class and its iso value: the answer to a click, in milliseconds."""
        with self.watch.step("similarity"):
            maps = self._similarity(classes)
            for similarity, annotated in zip(maps, classes, strict=True):
                if annotated.proximity > 0.0:
                    similarity *= proximity(self.features.geometry, annotated.positive, annotated.proximity)
            return [ClassMap(similarity, self._iso(similarity, classes, index)) for index, similarity in enumerate(maps)]

    def click_hint(self, low: ClassMap, classes: Sequence[AnnotatedClass]) -> np.ndarray:
        """Where a further click would tell most about the class of S_L `low`, (3,) RAS millimetres; see `click_hint`."""
        return click_hint(low.similarity, low.iso, self.features.geometry, classes)

    def refined_map(
        self,
        low: ClassMap,
        classes: Sequence[AnnotatedClass],
        index: int,
        method: RefinementMethod,
        between: Callable[[], None] = lambda: None,
    ) -> ClassMap:
        """S_H of the index-th class from its S_L, sharpened where the class asks for it, and its iso value.

        The iso value is chosen anew, since refinement changes the range of the map. `between` is called between steps, and may
        raise `Cancelled`.
        """
        annotated = classes[index]
        with self.watch.step("refinement"):
            wanted = method if annotated.refine else "none"
            similarity = refine(low.similarity, self.volume, self.display_window, annotated.positive, low.iso, wanted, between)
            between()
            iso = low.iso if wanted == "none" else self._refined_iso(similarity, classes, index)
            return ClassMap(similarity, iso)

    def segment(
        self,
        classes: Sequence[AnnotatedClass],
        method: RefinementMethod = "bilateral",
        only_annotated_components: bool = True,
        progress: Progress = no_progress,
        on_map: Callable[[AnnotatedClass, ClassMap], None] | None = None,
    ) -> Segmentation:
        """Segment all classes, each voxel going to one class at most.

        Args:
            classes: at least one, of different names, all points inside the volume.
            method: how maps are refined.
            only_annotated_components: drop the parts of a segment that hold none of its positive points.
            progress: told of classes done.
            on_map: is shown each full-resolution map before the next is made; they are not kept.

        Raises:
            InputError: the classes are not usable.
            Cancelled: by the progress callback.
        """
        check_classes(classes, self.volume.geometry)
        isos: list[float] = []

        def maps() -> Iterator[tuple[np.ndarray, float]]:
            progress(0, len(classes), "Segmenting classes")
            low_maps = self.low_resolution_maps(classes)
            for index, annotated in enumerate(classes):
                # In between as well: a click that comes now should not have to wait long.
                between = partial(progress, index, len(classes), "Segmenting classes")
                full = self.refined_map(low_maps[index], classes, index, method, between)
                between()
                if on_map:
                    on_map(annotated, full)
                isos.append(full.iso)
                yield full.similarity, full.iso
                progress(index + 1, len(classes), "Segmenting classes")

        labels = compete(maps(), self.volume.shape)
        with self.watch.step("components"):
            if only_annotated_components:
                for label, annotated in enumerate(classes, start=1):
                    keep_annotated_components(labels, label, self.volume.geometry, annotated.positive)
        return Segmentation(labels, tuple(self._results(classes, isos, labels)))

    def _extract(
        self, weights: WeightsFile, device: torch.device, progress: Progress, on_coarse: Callable[[], None] | None
    ) -> None:
        network = open_network(weights, device)
        if self.cache:
            self.cache.check_room(features_size_bytes(self.volume.geometry, self.feature_settings, weights.model))
        if on_coarse is None:
            features = extract_features(self.volume, network, self.feature_settings, progress)
        else:
            for features in progressive_features(self.volume, network, self.feature_settings, progress=progress):
                self.use_features(features)
                on_coarse()
        if self.cache:
            self.cache.put(features)
        if on_coarse is None:
            self.use_features(features)

    def _similarity(self, classes: Sequence[AnnotatedClass]) -> list[np.ndarray]:
        if self._kernel_similarity is not None:
            return list(self._kernel_similarity.maps(classes))
        average = mean_published_similarity if self.preset.similarity == "published" else mean_cosine
        return [mean_similarity_map(self.features, annotated, average) for annotated in classes]

    def _iso(self, similarity: np.ndarray, classes: Sequence[AnnotatedClass], index: int) -> float:
        """The iso value of the index-th class's S_L."""
        annotated = classes[index]
        if annotated.iso is not None:
            return annotated.iso
        if self._kernel_similarity is not None:
            return self._kernel_similarity.iso(annotated, similarity)
        return _iso_between_points(similarity, self.features.geometry, classes, index)

    def _refined_iso(self, similarity: np.ndarray, classes: Sequence[AnnotatedClass], index: int) -> float:
        """The iso value of the index-th class's S_H."""
        annotated = classes[index]
        if annotated.iso is not None:
            return annotated.iso
        if self._kernel_similarity is not None:
            return self._kernel_similarity.refined_iso(annotated, similarity, self.volume.geometry)
        return _iso_between_points(similarity, self.volume.geometry, classes, index)

    def _results(self, classes: Sequence[AnnotatedClass], isos: list[float], labels: np.ndarray) -> Iterator[ClassResult]:
        counts = np.bincount(labels.ravel(), minlength=len(classes) + 1)
        voxel_ml = self.volume.geometry.voxel_volume_mm3 / 1000.0
        for annotated, iso, count in zip(classes, isos, counts[1:].tolist(), strict=True):
            yield ClassResult(annotated.name, iso, count, count * voxel_ml)


def open_network(weights: WeightsFile, device: torch.device) -> VisionTransformer:
    """The model on its device, ready to run. Raises InputError where the file holds no such model."""
    from ..features.vision_transformer import VisionTransformer
    from ..weights.state_dict import load_state_dict

    return VisionTransformer(weights.model, load_state_dict(weights.path), weights.sha256, device)


def _iso_between_points(similarity: np.ndarray, geometry: Geometry, classes: Sequence[AnnotatedClass], index: int) -> float:
    """The iso value between a class's map at its positive points and at its negative and all other classes' points."""
    others = [other.positive for position, other in enumerate(classes) if position != index]
    positive, negative = classes[index].positive, np.concatenate([classes[index].negative, *others])
    return choose_iso(*(sample_at(similarity[..., None], geometry, points) for points in (positive, negative)))
