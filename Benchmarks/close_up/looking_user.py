"""A user who looks at some structures closely, once, as soon as the first click on every structure is answered."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.simulated_clicker import Clicks
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.classes.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.session.map_crop import SegmentCrops
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession


@dataclass(frozen=True)
class Press:
    """What became of "Look closer" on one structure.

    Attributes:
        structure: its name.
        size_mm: edges of the box along I, J and K; None: refused, since the box fills too much of the scan.
        voxels: of the box; None where it was refused.
        seconds: until the first map of it was there, features included; None where it was refused, or not timed.
    """

    structure: str
    size_mm: tuple[float, float, float] | None = None
    voxels: int | None = None
    seconds: float | None = None


class LookingUser:
    """Turns clicks into labels as the session does; at the first clicks, presses "Look closer" for some structures.

    The boxes fit what is shown then, and are never fitted again; points beyond them enlarge them, as always.

    Args:
        session: on the volume, with features and a source of further ones.
        presses: names of the structures that are to be looked at closely.
        reach_mm: as for `close_up_of`.

    Attributes:
        pressed: what became of each press, once there were clicks.
    """

    def __init__(self, session: SegmentationSession, presses: Collection[str], reach_mm: float = math.inf) -> None:
        self._session, self._presses, self._reach_mm = session, presses, reach_mm
        self._close_ups: dict[str, CloseUp] | None = None
        self.pressed: list[Press] = []

    def __call__(self, labelled: LabelledVolume, clicks: Clicks) -> np.ndarray:
        """Labels (K, J, I) from the clicks of each structure."""
        requests = classes_of(labelled.names, clicks, labelled.volume.geometry)
        if self._close_ups is None:
            self._close_ups = {}
            if self._presses:
                self._press(requests)
        closely = self._looking_closely(requests)
        self._session.look_closer(closely)
        return self._session.segment(closely).labels

    def _press(self, requests: Sequence[ClassRequest]) -> None:
        """One after the other, so that each can be timed."""
        assert self._close_ups is not None
        geometry = self._session.volume.geometry
        for request, shown in zip(requests, shown_maps(self._session, requests), strict=True):
            if request.name not in self._presses:
                continue
            try:
                close_up = close_up_of(shown, request.positive, geometry, self._reach_mm)
            except InputError:
                self.pressed.append(Press(request.name))
                continue
            self._close_ups[request.name] = close_up
            start = time.perf_counter()
            closely = self._looking_closely(requests)
            self._session.look_closer(closely)
            self._session.low_resolution_maps(closely)
            seconds = time.perf_counter() - start
            box = close_up.box_in(geometry, request.positive)
            voxels = int(np.prod([extent.stop - extent.start for extent in box]))
            self.pressed.append(Press(request.name, close_up.size_mm, voxels, seconds))

    def _looking_closely(self, requests: Sequence[ClassRequest]) -> list[ClassRequest]:
        close_ups = self._close_ups or {}
        return [replace(request, close_up=close_ups.get(request.name)) for request in requests]


def shown_maps(session: SegmentationSession, requests: Sequence[ClassRequest]) -> list[ClassMap]:
    """The maps by which structures are shown once they are refined."""
    crops = SegmentCrops()
    labels = session.segment(requests, on_map=crops.take).labels
    return [crop.on(session.volume.geometry) for crop in crops.of(labels)]
