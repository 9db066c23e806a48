"""Decides when to suggest a closer look: for structures whose extent is vague in the whole scan, or that are small in it.

For structures that begin with an outline, it decides from the outline when a closer look begins by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from ...compute.proxy import SegmentationProxy
from ...core.classes.class_map import ClassMap
from ...core.classes.close_up import CloseUp
from ...core.classes.close_up_choice import close_up_of
from ...core.classes.small_outlines import is_small, unasked_close_up
from ...core.classes.vague_extent import is_vague
from ...core.system.errors import InputError
from ..classes.class_state import ClassState, Polarity
from ..interface.message_texts import CloserLookReason
from ..interface.parameters import SceneParameters
from ..mrml.point_lists import Point
from ..mrml.transforms import world_to_local
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .asked_maps import AskedMaps

Placed = tuple[Polarity, Point]
"""A point of a class, with its polarity."""


@dataclass(frozen=True)
class Judgement:
    """What a class's map says about a closer look.

    Attributes:
        cells: the map.
        has_box: whether a close-up is possible, that is, not too large.
        vague: see `is_vague`.
    """

    cells: ClassMap
    has_box: bool
    vague: bool


@dataclass(frozen=True, eq=False)
class Drawn:
    """A diameter or an outline of a class; recognised as a step that placed points inside and outside at once.

    Attributes:
        points: the points that it placed.
        before: the points that the class had before.
        outline: (N, 3) RAS millimetres in the scene; None: it is a diameter, or the outline is not known.
        judged: whether the outline was compared with the shown map, which is done once.
    """

    points: frozenset[Placed]
    before: frozenset[Placed]
    outline: np.ndarray | None = None
    judged: bool = False

    @property
    def points_ras(self) -> np.ndarray:
        """The points that it placed, (N, 3) RAS millimetres in the scene."""
        return np.array([point for _, point in self.points])

    @property
    def begins(self) -> bool:
        """Whether it is an outline that was drawn before the class had any points."""
        return self.outline is not None and not self.before


class CloseUpHints:
    """Judges the maps of classes, and remembers how classes were drawn and which were looked at closely.

    Nothing of this is saved, because it only concerns what the user sees now.

    Args:
        parameters: give the chosen volume.
        annotations: hold the classes.
        volume: the open volume.
        maps: has the last requests.
        proxy: has the maps that are shown.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        volume: OpenedVolume,
        maps: AskedMaps,
        proxy: SegmentationProxy,
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._volume = volume
        self._maps = maps
        self._proxy = proxy
        self._classes: dict[str, ClassState] = {}
        self._known: dict[str, set[Placed]] = {}  # Also points that are gone: brought back, they are not drawn again.
        self._drawn: dict[str, Drawn] = {}
        self._looked_at: set[str] = set()
        self._unasked: dict[str, frozenset[Placed]] = {}  # By class: the points that it had then.
        self._judgements: dict[str, Judgement] = {}

    def forget(self) -> None:
        """What is there now was not placed on what is shown from now on: scene or volume are others."""
        self._classes = {state.id: state for state in self._annotations.classes}
        for state in self._annotations.classes:
            self._known.setdefault(state.id, set()).update(_placed(state))
        self._drawn = {}
        self._unasked = {}
        self._looked_at = {state.id for state in self._annotations.classes if state.close_up is not None}
        self._judgements = {}

    def note(self) -> None:
        """The annotations have changed, and what is shown has not followed yet."""
        before, self._classes = self._classes, {state.id: state for state in self._annotations.classes}
        for state in self._annotations.classes:
            if state.close_up is not None:
                self._looked_at.add(state.id)
            self._note_points(before.get(state.id), state)

    def note_outline(self, id_: str, outline_ras: np.ndarray) -> None:
        """What was drawn last of a class was its outline, (N, 3) RAS millimetres in the scene."""
        if id_ in self._drawn:
            self._drawn[id_] = replace(self._drawn[id_], outline=outline_ras)

    def take_unasked(self) -> dict[str, CloseUp]:
        """The classes that are to be looked at closely now, though nobody asked for it, and in which boxes, by their ids.

        Each outline is judged once, by the first refined map that follows from it; and a class that was looked at closely
        before is not again, since its user may have gone back to the whole. What was undone can still be redone: a closer look
        is a step of its own, and would put an end to that.
        """
        if self._proxy.phase != "ready" or not self._proxy.up_to_date or self._volume.changed or self._annotations.can_redo:
            return {}
        refined = {id_ for id_, is_refined in zip(self._proxy.maps, self._proxy.refined, strict=True) if is_refined}
        close_ups: dict[str, CloseUp] = {}
        for state in self._annotations.classes:
            close_up = self._unasked_close_up(state) if state.id in refined - self._looked_at else None
            if close_up is not None:
                close_ups[state.id] = close_up
                self._unasked[state.id] = frozenset(_placed(state))
        return close_ups

    def of(self, state: ClassState) -> CloserLookReason | None:
        """Why to look closer at a class; None: there is no known reason, or a close-up is not possible.

        - "small outline": a closer look has begun by itself; given until the class gets other points.
        - "small drawing": the last points are a diameter or an outline that is small.
        - "vague extent": the newest map hardly tells how far the structure reaches.

        The last two are suggestions, given only before the class's first close-up: whether the structure is small, thin or
        compact, only the user knows. They are not given for a structure that begins with an outline, because a closer look
        begins by itself there if it is worth it.
        """
        if state.close_up is not None and self._unasked.get(state.id) == frozenset(_placed(state)):
            return "small outline"
        if self._proxy.phase != "ready" or state.id in self._looked_at:
            return None
        judgement = self._judgement(state.id)
        if judgement is None or not judgement.has_box:
            return None
        drawn = self._drawn_last(state)
        if drawn is not None and drawn.begins:
            return None
        if drawn is not None and is_small(drawn.points_ras, judgement.cells.geometry.spacing_mm.max()):
            return "small drawing"
        return "vague extent" if judgement.vague else None

    def _note_points(self, was: ClassState | None, state: ClassState) -> None:
        known = self._known.setdefault(state.id, set())
        if was is None:
            known.update(_placed(state))
            return
        added: dict[Polarity, list[Point]] = {}
        for polarity in get_args(Polarity):
            then, now = getattr(was, polarity), getattr(state, polarity)
            new = [point for point in now if (polarity, point) not in known]
            known.update((polarity, point) for point in new)
            if new and len(then) != len(now):  # Otherwise a point was moved.
                added[polarity] = new
        if len(added) == len(get_args(Polarity)):
            self._drawn[state.id] = _drawn(was, added)

    def _judgement(self, id_: str) -> Judgement | None:
        """The judgement of a class's newest map; while a map is awaited, that of the one before."""
        cells, request, content = self._proxy.low_maps.get(id_), self._maps.requests.of(id_), self._volume.content
        if cells is None or request is None or content is None:
            return None
        judged = self._judgements.get(id_)
        if self._proxy.up_to_date and (judged is None or judged.cells is not cells):
            try:
                close_up_of(cells, request.positive, content.geometry)
                has_box = True
            except InputError:
                has_box = False
            judged = self._judgements[id_] = Judgement(cells, has_box, has_box and is_vague(cells, request.positive))
        return judged

    def _drawn_last(self, state: ClassState) -> Drawn | None:
        """A class's last diameter or outline, if all of its points exist and no point was placed since."""
        drawn, placed = self._drawn.get(state.id), set(_placed(state))
        return drawn if drawn is not None and drawn.points <= placed <= drawn.before | drawn.points else None

    def _unasked_close_up(self, state: ClassState) -> CloseUp | None:
        """The close-up of a class that begins with a small outline and whose map differs from it; None: no close-up."""
        volume, content, request = self._parameters.volume, self._volume.content, self._maps.requests.of(state.id)
        drawn = self._drawn.get(state.id)
        if volume is None or content is None or request is None or drawn is None or not drawn.begins or drawn.judged:
            return None
        if not drawn.points <= set(_placed(state)):
            return None
        self._drawn[state.id] = replace(drawn, judged=True)
        assert drawn.outline is not None
        shown, cell_mm = self._proxy.maps[state.id], self._proxy.low_maps[state.id].geometry.spacing_mm.max()
        outline = world_to_local(volume, drawn.outline)
        return unasked_close_up(shown, outline, request.positive, content.geometry, cell_mm)


def _drawn(was: ClassState, added: dict[Polarity, list[Point]]) -> Drawn:
    """The drawing that added these points to a class in one step."""
    placed = frozenset((polarity, point) for polarity, points in added.items() for point in points)
    return Drawn(placed, frozenset(_placed(was)))


def _placed(state: ClassState) -> Iterator[Placed]:
    for polarity in get_args(Polarity):
        for point in getattr(state, polarity):
            yield polarity, point
