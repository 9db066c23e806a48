"""The maps of classes that have come from the compute process, each to be shown until a newer one comes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from ..core.classes.class_map import ClassMap, in_units_of
from ..core.classes.class_request import ClassRequest
from .requests import ComputeMaps, FirstMap, Maps, MeasureMaps, RefinedMaps, RefineMaps, Volumes

T = TypeVar("T")

HARDLY_CHANGED = 0.05
"""Of a class's cells, so many may be others than before for its refined map still to be shown."""


class AnsweredMaps:
    """Takes in what comes of maps, in the order in which it comes.

    Attributes:
        maps: by class id; S_H where it has come, also for classes that a later answer left about as they were: these keep it
            until it comes anew; else S_L. From when the map of the class that is waited for has come until all others have,
            those are as before.
        low_maps: by class id, S_L, also where `maps` are refined.
        low_classes: what `low_maps` are the answer to.
        volumes_ml: by class id, of the segment that the class gets by these maps, millilitres; a moment later than the maps.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Nothing has come: the volume is another one, or no class is left."""
        self.maps: dict[str, ClassMap] = {}
        self.low_maps: dict[str, ClassMap] = {}
        self.low_classes: tuple[ClassRequest, ...] = ()
        self.volumes_ml: dict[str, float] = {}
        # What `maps` are the answer to.
        self._classes: tuple[ClassRequest, ...] = ()
        self._first: ClassMap | None = None
        # By class id, S_H that came last, and what it is the answer to.
        self._refined_maps: dict[str, tuple[ClassRequest, ClassMap]] = {}

    @property
    def first_came(self) -> bool:
        """Whether of the maps that were asked for last, that of the class that is waited for has come."""
        return self._first is not None

    @property
    def refined(self) -> tuple[bool, ...]:
        """Of each of `maps`, whether it is S_H."""
        return tuple(class_map is self._refined_maps.get(id_, (None, None))[1] for id_, class_map in self.maps.items())

    def expect(self) -> None:
        """Other maps were asked for: what has come of those before is not part of them."""
        self._first = None

    def take_first(self, request: ComputeMaps, reply: FirstMap) -> None:
        """S_L of the class that is waited for has come."""
        self._first = reply.map
        self.maps = {**self.maps, request.first: reply.map}
        # They are of no one request until the others come.
        self._classes = ()

    def take(self, request: ComputeMaps, reply: Maps, refining: bool) -> None:
        """S_L of all other classes have come; whether S_H of all will follow, `refining` says."""
        maps = list(reply.maps)
        if self._first is not None:
            maps.insert([annotated.id for annotated in request.classes].index(request.first), self._first)
        shown, before = self.maps, self.low_maps
        self._take(request.classes, maps)
        self.low_classes, self.low_maps = request.classes, self.maps
        if not refining:
            return
        kept = {
            annotated.id: shown[annotated.id]
            for annotated in request.classes
            if self._is_refined(shown, annotated) and _hardly_changed(before.get(annotated.id), self.low_maps[annotated.id])
        }
        if kept:
            self.maps = {**self.low_maps, **kept}

    def take_volumes(self, request: MeasureMaps, reply: Volumes) -> None:
        """It is known how large segments are by S_L. Of classes that show S_H, it was known already."""
        by_refined = {a.id: self.volumes_ml[a.id] for a in request.classes if self._is_refined(self.maps, a)}
        self.volumes_ml = {**_by_id(request.classes, reply.volumes_ml), **by_refined}

    def take_refined(self, request: RefineMaps, reply: RefinedMaps) -> None:
        """S_H of all classes have come, and volumes by them."""
        self._take(request.classes, reply.maps)
        self._refined_maps = {annotated.id: (annotated, self.maps[annotated.id]) for annotated in request.classes}
        self.volumes_ml = _by_id(request.classes, reply.volumes_ml)

    def resize(self, classes: tuple[ClassRequest, ...]) -> None:
        """Let `maps` be of other iso values and sizes, where nothing else about the classes differs from what they are of."""
        low = self.low_classes
        if classes == self._classes or len(classes) != len(low) or not all(map(ClassRequest.asks_for_map_of, classes, low)):
            return
        # Refined maps end near the surface that they were made for.
        self.low_maps = {request.id: self.low_maps[request.id].resized(request) for request in classes}
        self.maps, self._classes = self.low_maps, classes

    def _is_refined(self, maps: Mapping[str, ClassMap], annotated: ClassRequest) -> bool:
        """Whether the map of a class among these is S_H, and the answer to what is asked for now."""
        request, refined = self._refined_maps.get(annotated.id, (None, None))
        return refined is not None and maps.get(annotated.id) is refined and request == annotated

    def _take(self, classes: tuple[ClassRequest, ...], maps: Sequence[ClassMap]) -> None:
        self._classes = classes
        self.maps = _by_id(classes, maps)
        self.volumes_ml = {id_: volume_ml for id_, volume_ml in self.volumes_ml.items() if id_ in self.maps}


def _by_id(classes: Sequence[ClassRequest], values: Sequence[T]) -> dict[str, T]:
    return dict(zip([annotated.id for annotated in classes], values, strict=True))


def _hardly_changed(before: ClassMap | None, after: ClassMap) -> bool:
    """Whether two maps of a class on the same cells select about the same ones."""
    # There is none before where memory sufficed for S_H, a moment after it had not for S_L.
    if before is None:
        return False
    was, now = (each.array >= in_units_of(each.array, each.iso) for each in (before, after))
    return int(np.count_nonzero(was != now)) <= HARDLY_CHANGED * int(np.count_nonzero(was))
