"""Serves the requests to the compute process, with a `SegmentationSession`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..core.classes.class_map import ClassMap
from ..core.classes.class_request import ClassRequest
from ..core.system.errors import Cancelled, InputError
from ..core.system.progress import Between, Progress, nothing_between
from ..core.volumes.bounding_box import bounding_box, whole_box
from ..core.volumes.intensity_window import looks_like_hounsfield_units, without_high_padding
from ..core.volumes.volume import Volume
from ..features.networks import Networks
from ..rendering.composition import COMPOSING
from ..rendering.intensity_levels import gray_levels, intensity_levels
from ..rendering.iso_surfaces import similarity_volume
from ..rendering.structure_volume import StructureVolume, structure_volume
from ..rendering.transfer_function import transfer_function_volume
from ..session.feature_estimate import FeatureEstimate
from ..session.map_crop import MapCrop, SegmentCrops
from ..session.opening import open_session
from ..session.segmentation import Segmentation
from ..session.segmentation_session import SegmentationSession
from .requests import (
    ComputeMaps,
    Done,
    Extract,
    Labels,
    Loaded,
    LookCloser,
    Maps,
    MeasureMaps,
    Prepare,
    RefinedMaps,
    RefineMaps,
    Refinement,
    ReleaseVolume,
    Render,
    SegmentClasses,
    Taken,
    TakeVolume,
    Volumes,
)
from .shown_maps import Shown, on_one_box


@dataclass(frozen=True, eq=False)
class _Segmented:
    """A segmentation, the request for it, and its maps, cropped to the boxes that matter; see `_segment`."""

    asked: tuple[tuple[ClassRequest, ...], Refinement, tuple[str, ...]]
    segmentation: Segmentation
    crops: tuple[MapCrop, ...]

    @property
    def crop_of(self) -> dict[str, MapCrop]:
        """The crops by class id."""
        return {annotated.id: crop for annotated, crop in zip(self.asked[0], self.crops, strict=True)}


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A volume as it is drawn in 3D.

    Attributes:
        array: its intensities (K, J, I), without padding that would look like bone.
        levels: the intensities that are told apart (`intensity_levels`).
        hounsfield: whether they are Hounsfield units.
    """

    array: np.ndarray
    levels: np.ndarray
    hounsfield: bool


class SegmentationService:
    """Serves requests about one volume, one after the other; `ComputeMaps` may be served by another thread at the same time.

    Args:
        progress: called during all requests but `ComputeMaps`; may raise `Cancelled`. The next request is then served as if the
            cancelled one had not been made, except that coarse features which it computed can be used.
        on_coarse: called whenever coarse or finer features are ready while the final ones are still computed.
        between_points: called before `ComputeMaps` computes what it needs of each new point; may raise `Cancelled` as well.
        on_preparable: called whenever `prepare_clicks` has something new to do.
        on_first_map: called with the map of the class that the user waits for, before the others are computed; the reply then
            has only the others.
    """

    def __init__(
        self,
        progress: Progress,
        on_coarse: Callable[[], None] | None = None,
        between_points: Between = nothing_between,
        on_preparable: Callable[[], None] = lambda: None,
        on_first_map: Callable[[ClassMap], None] | None = None,
    ) -> None:
        self._progress = progress
        self._between_points = between_points
        self._on_coarse = on_coarse
        self._on_preparable = on_preparable
        self._on_first_map = on_first_map
        self._networks = Networks()
        self._volume: Volume | None = None
        self._session: SegmentationSession | None = None
        self._maps: dict[str, ClassMap] = {}
        self._segmented: _Segmented | None = None
        self._drawn: _Drawn | None = None
        self._handlers: dict[type, Callable[[Any], Any]] = {
            TakeVolume: self._take_volume,
            ReleaseVolume: self._release_volume,
            Prepare: self._prepare,
            Extract: self._extract,
            LookCloser: self._look_closer,
            ComputeMaps: self._compute_maps,
            MeasureMaps: self._measure_maps,
            RefineMaps: self._refine_maps,
            SegmentClasses: self._segment_classes,
            Render: self._render,
        }

    def serve(self, request: Any) -> Any:
        """Do what a request of `requests` asks, and return its reply.

        Raises:
            InputError: something in it cannot be used.
            Cancelled: by the progress callback.
        """
        return self._handlers[type(request)](request)

    def prepare_clicks(self) -> None:
        """Compute in advance what the first click would wait for. To be called by the thread that serves `ComputeMaps`."""
        session = self._session
        if session is not None:
            # An error here occurs again when a click needs the same, and is reported then.
            with suppress(Exception):
                session.prepare_clicks()

    def _take_volume(self, request: TakeVolume) -> Taken:
        # Before the new one is made: if it is refused, there must be no volume.
        self._forget()
        self._volume = Volume(request.array, request.geometry, request.name)
        return Taken(self._volume.digest.hex())

    def _release_volume(self, request: ReleaseVolume) -> Done:
        self._forget()
        return Done()

    def _forget(self) -> None:
        self._volume = self._session = self._segmented = self._drawn = None
        self._maps = {}

    def _prepare(self, request: Prepare) -> FeatureEstimate:
        self._session = self._segmented = None
        # Front ends ask the user before they allow a download, and say if no hash is published (`WeightsDownload`).
        session = open_session(
            self._the_volume, request.settings, networks=self._networks, trust=lambda *_: True, ask_first=True
        )
        estimate = session.estimate(coarse_first=self._on_coarse is not None)
        self._session = session
        return estimate

    def _extract(self, request: Extract) -> Loaded:
        session = self._the_session
        # It may be a segmentation from coarse features, if the computation of finer ones was cancelled before.
        self._segmented = None
        self._on_preparable()
        session.load_features(self._progress, self._on_coarse and self._tell_of_coarse)
        self._on_preparable()
        return Loaded(session.not_kept)

    def _tell_of_coarse(self) -> None:
        assert self._on_coarse is not None
        self._on_preparable()
        self._on_coarse()

    def _look_closer(self, request: LookCloser) -> Loaded:
        self._the_session.look_closer(request.classes, self._progress)
        return Loaded(self._the_session.not_kept)

    def _compute_maps(self, request: ComputeMaps) -> Maps:
        session = self._the_session
        # Asked before the maps are computed: close-ups that are loaded meanwhile are not in these maps.
        awaiting = session.awaiting_close_ups(request.classes)
        told: list[ClassMap] = []

        def tell(first: ClassMap) -> None:
            if self._on_first_map is not None:
                self._on_first_map(first)
                told.append(first)

        maps = session.low_resolution_maps(request.classes, self._between_points, request.first, tell)
        self._maps = {annotated.id: low for annotated, low in zip(request.classes, maps, strict=True)}
        return Maps(tuple(low for low in maps if low not in told), awaiting)

    def _measure_maps(self, request: MeasureMaps) -> Volumes:
        maps = list(self._maps.values())
        _check_are_of(maps, request.classes)
        classes, only_annotated = request.classes, request.only_annotated_components
        return Volumes(self._the_session.low_resolution_volumes_ml(classes, maps, only_annotated))

    def _refine_maps(self, request: RefineMaps) -> RefinedMaps:
        geometry = self._the_volume.geometry
        segmented = self._segment(request.classes, request.refinement)
        maps = tuple(crop.on(geometry) for crop in segmented.crops)
        return RefinedMaps(maps, tuple(result.millilitres for result in segmented.segmentation.classes))

    def _segment_classes(self, request: SegmentClasses) -> Labels:
        self._the_session.look_closer(request.classes, self._progress)
        return cropped_labels(self._segment(request.classes, request.refinement).segmentation.labels, len(request.classes))

    def _render(self, request: Render) -> StructureVolume:
        session = self._the_session
        scan = session.volume.geometry
        shown = self._shown_maps(request.refined)
        isos = [each.iso for each in shown]
        maps, box, shape = on_one_box(shown, scan.shape, request.surroundings)
        # Called often, so that a click that comes meanwhile is not slowed down for long.
        between = partial(self._progress, len(maps), len(maps), COMPOSING)
        drawn = self._as_drawn()
        intensities = drawn.array[box]
        if request.mode == "similarity":
            composition = similarity_volume(maps, isos, shape, self._progress)
        else:
            composition = transfer_function_volume(intensities, session.display_window, maps, isos, shape, self._progress)
        between()
        shape = composition.shape
        # Without surroundings, a smaller box: renderers take time for each pixel that the box covers.
        part = whole_box(shape) if request.surroundings else composition.crop()
        gray = gray_levels(intensities, drawn.levels, shape, part)
        between()
        voxels = composition.voxels(gray, request.casting)
        between()
        geometry = scan.part(box).resized(shape).part(part)
        return structure_volume(voxels, len(maps), drawn.levels, geometry, scan, hounsfield=drawn.hounsfield)

    def _as_drawn(self) -> _Drawn:
        """The volume as 3D views show it; found once, since many voxels are read for it."""
        if self._drawn is None:
            volume = without_high_padding(self._the_volume)
            self._drawn = _Drawn(volume.array, intensity_levels(volume), looks_like_hounsfield_units(volume))
        return self._drawn

    def _shown_maps(self, refined: Sequence[bool]) -> list[Shown]:
        """The maps of the last `ComputeMaps`: for each class, S_H if `refined` and if it is known, else S_L."""
        maps = self._maps
        _check_are_of(maps, refined)
        fine = self._segmented.crop_of if self._segmented is not None else {}
        return [fine.get(id_, low) if is_refined else low for (id_, low), is_refined in zip(maps.items(), refined, strict=True)]

    def _segment(self, classes: tuple[ClassRequest, ...], refinement: Refinement) -> _Segmented:
        """The segmentation of these classes, made again only if the request differs or close-ups have been loaded since."""
        known, asked = self._segmented, (classes, refinement, self._the_session.awaiting_close_ups(classes))
        if known is None or known.asked != asked:
            crops = SegmentCrops()
            segmentation = self._the_session.segment(
                classes, refinement.method, refinement.only_annotated_components, self._progress, crops.take
            )
            self._segmented = known = _Segmented(asked, segmentation, crops.of(segmentation.labels))
        return known

    @property
    def _the_volume(self) -> Volume:
        if self._volume is None:
            raise InputError("No volume was chosen; choose the one to segment.")
        return self._volume

    @property
    def _the_session(self) -> SegmentationSession:
        if self._session is None:
            raise InputError("The volume or its settings cannot be used; correct them first.")
        return self._session


def _check_are_of(maps: Collection[Any], classes: Sequence[Any]) -> None:
    """Raise Cancelled if the last maps are of more or fewer classes: a later click has made this request obsolete."""
    if len(maps) != len(classes):
        raise Cancelled


def cropped_labels(labels: np.ndarray, classes: int) -> Labels:
    """A label map (K, J, I) of a volume, cropped to the box that its classes fill; one byte a voxel for up to 255 classes."""
    box = bounding_box(labels) or (slice(0, 0), slice(0, 0), slice(0, 0))
    k, j, i = (extent.start for extent in box)
    return Labels(np.ascontiguousarray(labels[box], np.uint8 if classes < 256 else np.uint16), (k, j, i))
