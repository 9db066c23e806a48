"""What the compute process can be asked for: a `SegmentationSession`, with requests and replies that are plain data.

Each public method serves one kind of request; its keyword arguments are the request's content, its result is the reply.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.annotations import AnnotatedClass, Color
from ..core.errors import InputError
from ..core.geometry import Box, Geometry
from ..core.intensity_window import IntensityWindow
from ..core.progress import Progress
from ..core.volume import Volume
from ..features.cache import FeatureCache
from ..features.cost import FeatureCost, NetworkSpeed, calibrate, feature_cost
from ..features.device import choose_device
from ..features.extraction import features_size_bytes
from ..features.settings import feature_key
from ..refinement.refinement import RefinementMethod
from ..rendering.color_volume import similarity_rgba, transfer_function_rgba
from ..session.map_crop import MapCrop, crop_map, on_common_box, restricted
from ..session.presets import preset
from ..session.segmentation_session import ClassMap, Segmentation, SegmentationSession, open_network
from ..weights.models import pretrained_model
from ..weights.sources import WeightsFile, WeightsUnavailable, find_weights, identify_model
from ..weights.store import weights_folder
from .messages import Message


@dataclass(frozen=True, eq=False)
class _Segmented:
    """A segmentation, what it was asked for, and its maps where they matter."""

    asked_for: str
    segmentation: Segmentation
    crops: tuple[MapCrop, ...]


class SegmentationService:
    """Serves requests about one volume.

    Args:
        progress: told of the work of every request; may raise `Cancelled`, after which the next request is served as if the
            cancelled one had not been made. While features are extracted it may ask for maps, where `answers_meanwhile`.
        on_coarse: called whenever there are coarser or finer features while the final ones are still computed.
    """

    def __init__(self, progress: Progress, on_coarse: Callable[[], None] | None = None) -> None:
        self._progress = progress
        self._on_coarse = on_coarse
        self._extracting = False
        self._speeds: dict[tuple[str, str, str], NetworkSpeed] = {}
        self._volume: Volume | None = None
        self._session: SegmentationSession | None = None
        self._maps: list[ClassMap] = []
        self._segmented: _Segmented | None = None
        self._chosen: tuple[str, str | None, str] = ("", None, "auto")

    def volume(self, array: np.ndarray, *, ijk_to_ras: list[list[float]], name: str) -> Message:
        """Take a volume (K, J, I); everything that follows is about it.

        Raises:
            InputError: it cannot be segmented.
        """
        self._session = self._segmented = None
        self._volume = Volume(array, Geometry(array.shape, np.array(ijk_to_ras)), name)
        return Message({})

    def prepare(
        self,
        *,
        preset_name: str,
        grid: int | None,
        window: tuple[float, float] | None,
        model: str | None,
        weights_path: str | None,
        device: str,
    ) -> Message:
        """Choose the settings, and tell what their features will cost: "cached", "memory_bytes", "download_mb".

        Raises:
            InputError: a setting cannot be used.
        """
        self._session = self._segmented = None
        chosen = preset(preset_name)
        settings = chosen.features if grid is None else replace(chosen.features, grid=grid)
        if window is not None:
            settings = replace(settings, windows=(IntensityWindow(*window),) * 3)
        session = SegmentationSession(self._the_volume(), chosen, settings, FeatureCache())
        name = model or identify_model(weights_path) or chosen.model
        self._chosen = (name, weights_path, device)
        weights = self._known_weights()
        self._session = session
        cached = weights is not None and self._is_cached(session, weights)
        here = weights is not None and weights.path.exists()
        told: dict[str, Any] = {"cached": cached, "download_mb": 0 if here else pretrained_model(name).size_mb}
        if here and weights is not None and not cached:
            cost = self._cost(session, weights)
            return Message({**told, "seconds": cost.seconds, "memory_bytes": cost.peak_bytes})
        size = features_size_bytes(session.volume.geometry, settings, pretrained_model(name))
        return Message({**told, "seconds": None, "memory_bytes": size})

    def extract(self) -> Message:
        """Load the features, from the cache or by computing them. Tells "cached" and the "device".

        Raises:
            InputError: weights or device are not to be had.
        """
        session = self._the_session()
        name, path, device = self._chosen
        weights = self._known_weights()
        if weights is None or not (weights.path.exists() or self._is_cached(session, weights)):
            weights = find_weights(name, path, progress=self._progress)
        self._extracting = True
        try:
            provenance = session.load_features(weights, choose_device(device), self._progress, self._on_coarse)
        finally:
            self._extracting = False
        return Message({"cached": provenance.cached, "device": provenance.device})

    @property
    def answers_meanwhile(self) -> bool:
        """Whether features are being extracted, and maps can be had of coarser ones."""
        return self._extracting and self._session is not None and self._session.has_features

    def maps(self, *, classes: list[dict[str, Any]]) -> Message:
        """S_L of all classes: array (classes, K', J', I') float32; "isos", and "ijk_to_ras" of the cells."""
        session = self._the_session()
        self._maps = session.low_resolution_maps(_annotated(classes))
        stacked = np.stack([low.similarity for low in self._maps])
        ijk_to_ras = session.features.geometry.ijk_to_ras.tolist()
        return Message({"isos": [low.iso for low in self._maps], "ijk_to_ras": ijk_to_ras}, (stacked,))

    def refine(self, *, classes: list[dict[str, Any]], method: RefinementMethod, only_annotated: bool) -> Message:
        """S_H of all classes where it matters: an array each (`MapCrop`), with "iso", "ijk_to_ras" and "millilitres"."""
        segmented = self._segment(classes, method, only_annotated)
        geometry = self._the_session().volume.geometry
        described = [
            {"iso": crop.iso, "ijk_to_ras": geometry.part(crop.box).ijk_to_ras.tolist(), "millilitres": result.millilitres}
            for crop, result in zip(segmented.crops, segmented.segmentation.classes, strict=True)
        ]
        return Message({"maps": described}, tuple(crop.array for crop in segmented.crops))

    def segment(self, *, classes: list[dict[str, Any]], method: RefinementMethod, only_annotated: bool) -> Message:
        """Labels of all classes, (K, J, I) uint16, 1 + index of the class."""
        return Message({}, (self._segment(classes, method, only_annotated).segmentation.labels,))

    def render(self, *, rendering: str, refined: bool, styles: list[tuple[Color, float]]) -> Message:
        """The last maps, or the last refined ones, as a volume of colours (K', J', I', 4) uint8; "ijk_to_ras" of it.

        Args:
            rendering: "similarity" for surfaces alone; "transfer function" for the volume's own detail within them.
            refined: whether the refined maps are meant.
            styles: of each class, colour and opacity.
        """
        geometry = self._the_session().volume.geometry
        maps, isos, box = self._shown(refined)
        colors, opacities = [color for color, _ in styles], [opacity for _, opacity in styles]
        part = geometry.part(box)
        if rendering == "similarity":
            rgba = similarity_rgba(maps, isos, colors, opacities, self._progress)
        else:
            session = self._the_session()
            intensities, window = session.volume.array[box], session.display_window
            rgba = transfer_function_rgba(intensities, window, maps, isos, colors, opacities, self._progress)
        return Message({"ijk_to_ras": part.resized(rgba.shape[:3]).ijk_to_ras.tolist()}, (rgba,))

    def _shown(self, refined: bool) -> tuple[list[np.ndarray], list[float], Box]:
        """The maps that were told last, on one grid each, their iso values, and the part of the volume that they fill."""
        if refined and self._segmented is not None:
            arrays, box = on_common_box(self._segmented.crops)
            return arrays, [crop.iso for crop in self._segmented.crops], box
        k, j, i = (slice(0, size) for size in self._the_volume().shape)
        return [low.similarity for low in self._maps], [low.iso for low in self._maps], (k, j, i)

    def _segment(self, classes: list[dict[str, Any]], method: RefinementMethod, only_annotated: bool) -> _Segmented:
        """The segmentation of these classes, which is made once for the same question."""
        question = json.dumps([classes, method, only_annotated])
        if self._segmented is None or self._segmented.asked_for != question:
            session = self._the_session()
            crops: list[MapCrop] = []

            def crop(annotated: AnnotatedClass, full: ClassMap) -> None:
                crops.append(crop_map(full.similarity, full.iso))

            segmentation = session.segment(_annotated(classes), method, only_annotated, self._progress, crop)
            labelled = (restricted(crop, segmentation.labels, label) for label, crop in enumerate(crops, start=1))
            self._segmented = _Segmented(question, segmentation, tuple(labelled))
        return self._segmented

    def _cost(self, session: SegmentationSession, weights: WeightsFile) -> FeatureCost:
        """What extracting the features will take on the chosen device, which is calibrated once."""
        device = choose_device(self._chosen[2])
        precision = session.feature_settings.precision
        network = open_network(weights, device)
        key = (weights.sha256, str(device), precision)
        if key not in self._speeds:
            self._speeds[key] = calibrate(network, session.feature_settings)
        return feature_cost(session.volume, session.feature_settings, network, self._speeds[key])

    def _known_weights(self) -> WeightsFile | None:
        """The weights, if they are here; if not, what is published of them; None where nothing is."""
        name, path, _ = self._chosen
        try:
            return find_weights(name, path, allow_download=False)
        except WeightsUnavailable:
            model = pretrained_model(name)
            if model.sha256 is None:
                return None
            return WeightsFile(weights_folder() / model.file_name, model.sha256, model, "not on this computer")

    def _is_cached(self, session: SegmentationSession, weights: WeightsFile) -> bool:
        key = feature_key(session.volume, weights.model.name, weights.sha256, session.feature_settings)
        return session.cache is not None and key in session.cache

    def _the_volume(self) -> Volume:
        if self._volume is None:
            raise InputError("No volume was chosen; choose the one to segment.")
        return self._volume

    def _the_session(self) -> SegmentationSession:
        if self._session is None:
            raise InputError("The volume's settings cannot be used; mend them first.")
        return self._session


def _annotated(classes: Sequence[dict[str, Any]]) -> list[AnnotatedClass]:
    # Colours are the business of who shows the results.
    return [AnnotatedClass(color=(0.0, 0.0, 0.0), **fields) for fields in classes]
