"""The maps of classes that have come from the compute process, each to be shown until a newer one comes."""

from __future__ import annotations

from collections.abc import Sequence

from ..core.class_map import ClassMap
from ..core.class_request import ClassRequest
from .requests import ComputeMaps, FirstMap, Maps, MeasureMaps, RefinedMaps, RefineMaps, Volumes


class AnsweredMaps:
    """Takes in what comes of maps, in the order in which it comes.

    Attributes:
        maps: by class id; S_H where `refined`, else S_L. From when the map of the class that is waited for has come until all
            others have, those are as before.
        refined: whether they are S_H.
        low_maps: by class id, S_L, also where `maps` are refined.
        low_classes: what `low_maps` are the answer to.
        volumes_ml: by class id, of the segment that the class gets by these maps, millilitres; a moment later than the maps.
    """

    def __init__(self) -> None:
        self.maps: dict[str, ClassMap] = {}
        self.refined = False
        self.low_maps: dict[str, ClassMap] = {}
        self.low_classes: tuple[ClassRequest, ...] = ()
        self.volumes_ml: dict[str, float] = {}
        # What `maps` are the answer to.
        self._classes: tuple[ClassRequest, ...] = ()
        self._first: ClassMap | None = None

    @property
    def first_came(self) -> bool:
        """Whether of the maps that were asked for last, that of the class that is waited for has come."""
        return self._first is not None

    def expect(self) -> None:
        """Other maps were asked for: what has come of those before is not part of them."""
        self._first = None

    def take_first(self, request: ComputeMaps, reply: FirstMap) -> None:
        """S_L of the class that is waited for has come."""
        self._first = reply.map
        self.maps = {**self.maps, request.first: reply.map}
        # They are of no one request until the others come.
        self._classes = ()

    def take(self, request: ComputeMaps, reply: Maps) -> None:
        """S_L of all other classes have come."""
        maps = list(reply.maps)
        if self._first is not None:
            maps.insert([annotated.id for annotated in request.classes].index(request.first), self._first)
        self._take(request.classes, maps)
        self.low_classes, self.low_maps, self.refined = request.classes, self.maps, False

    def take_volumes(self, request: MeasureMaps | RefineMaps, reply: Volumes | RefinedMaps) -> None:
        """It is known how large segments are by these maps."""
        ids = [annotated.id for annotated in request.classes]
        self.volumes_ml = dict(zip(ids, reply.volumes_ml, strict=True))

    def take_refined(self, request: RefineMaps, reply: RefinedMaps) -> None:
        """S_H of all classes have come, and volumes by them."""
        self._take(request.classes, reply.maps)
        self.refined = True
        self.take_volumes(request, reply)

    def resize(self, classes: tuple[ClassRequest, ...]) -> None:
        """Let `maps` be of other iso values and sizes, where nothing else about the classes differs from what they are of."""
        low = self.low_classes
        if classes == self._classes or len(classes) != len(low) or not all(map(ClassRequest.asks_for_map_of, classes, low)):
            return
        # Refined maps end near the surface that they were made for.
        self.low_maps = {request.id: self.low_maps[request.id].resized(request) for request in classes}
        self.maps, self.refined, self._classes = self.low_maps, False, classes

    def _take(self, classes: tuple[ClassRequest, ...], maps: Sequence[ClassMap]) -> None:
        self._classes = classes
        self.maps = dict(zip([annotated.id for annotated in classes], maps, strict=True))
