"""Which structures a closer look may find better: those that needed large corrections in the whole scan, or are small in it.

Of these, the ones that begin with an outline are looked at closely unasked, where the outline itself says that they should be.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from ...compute.proxy import SegmentationProxy
from ...core.classes.class_map import ClassMap
from ...core.classes.close_up import CloseUp
from ...core.classes.close_up_choice import close_up_of
from ...core.classes.gross_correction import corrects_grossly
from ...core.classes.small_outlines import is_small, unasked_close_up
from ...core.system.errors import InputError
from ..classes.class_state import ClassState, Polarity
from ..interface.parameters import SceneParameters
from ..interface.wording import CloserLookReason
from ..mrml.point_lists import Point
from ..mrml.transforms import world_to_local
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .asked_maps import AskedMaps

ENOUGH = 2
"""Gross corrections of a class, from which on a box is worth it on average; see `Benchmarks/results/candidates.md`."""

Placed = tuple[Polarity, Point]
"""A point as a class has it."""


@dataclass(frozen=True)
class Correction:
    """What was placed in one step: a point, a stroke, or the points of a region, an outline or a diameter.

    Attributes:
        step: later ones have higher numbers.
        gross: whether a point of it lay deep within what was wrong (`corrects_grossly`), more than a cell's edge.
    """

    step: int
    gross: bool


@dataclass(frozen=True, eq=False)
class Drawn:
    """A diameter or an outline of a class: what placed points on it and off it in one step.

    Attributes:
        points: of it.
        before: those that were there already.
        outline: (N, 3) RAS millimetres in the scene; None: it is a diameter, or it is not known.
        judged: whether the outline was compared with what is shown, which is done once.
    """

    points: frozenset[Placed]
    before: frozenset[Placed]
    outline: np.ndarray | None = None
    judged: bool = False

    @property
    def begins(self) -> bool:
        """Whether it is the outline that a structure begins with."""
        return self.outline is not None and not self.before


class CloseUpHints:
    """Keeps in mind how classes were drawn and corrected.

    A correction is judged once, when it is placed, by what is shown of the class until then. Points of which nothing was shown
    are no corrections: those of a saved scene or of another volume, of a class that is new, or placed before the answer to the
    ones before. A point that is moved, taken back or brought back stays what it was.

    None of what is kept in mind is saved: it speaks of what the user sees now.

    Args:
        parameters: say which volume.
        annotations: hold the classes.
        volume: is being looked at.
        maps: that were asked for last.
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
        # None: it corrected nothing that was shown.
        self._known: dict[str, dict[Placed, Correction | None]] = {}
        self._drawn: dict[str, Drawn] = {}
        self._looked_at: set[str] = set()
        self._unasked: dict[str, frozenset[Placed]] = {}  # By class: the points that it had then.
        self._boxes: dict[str, tuple[ClassMap, bool]] = {}
        self._step = 0

    def forget(self) -> None:
        """What is there now was not placed on what is shown from now on: scene or volume are others."""
        self._classes = {state.id: state for state in self._annotations.classes}
        self._known = {id_: dict.fromkeys(known) for id_, known in self._known.items()}
        for state in self._annotations.classes:
            self._known.setdefault(state.id, {}).update(dict.fromkeys(_placed(state)))
        self._drawn = {}
        self._unasked = {}
        self._looked_at = {state.id for state in self._annotations.classes if state.close_up is not None}
        self._boxes = {}

    def note(self) -> None:
        """The annotations have changed, and what is shown has not followed yet."""
        before, self._classes = self._classes, {state.id: state for state in self._annotations.classes}
        if not self._annotations.continued:
            self._step += 1
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
        """Why a class should be looked at closer, as far as one can tell; None: no reason is known, or it cannot be.

        "small outline": it is, without having been asked for; until the class gets other points.

        Whether it is small, thin or compact, its user knows. The other reasons hold only before its first close-up, and until a
        correction that is not gross:

        - "large corrections": from its second gross one on, one of which was off the structure: else it may be several like
          objects, clicked one after the other.
        - "small drawing": its last diameter or outline is small, and is not the outline that it begins with: whether a closer
          look is worth it then, is judged without the user.
        """
        if state.close_up is not None and self._unasked.get(state.id) == frozenset(_placed(state)):
            return "small outline"
        if self._proxy.phase != "ready" or state.id in self._looked_at:
            return None
        reason = self._reason(state)
        return reason if reason and self._may_have_box(state.id) else None

    def _note_points(self, was: ClassState | None, state: ClassState) -> None:
        known = self._known.setdefault(state.id, {})
        if was is None:
            known.update({placed: known.get(placed) for placed in _placed(state)})
            return
        added: dict[Polarity, list[Point]] = {}
        for polarity in get_args(Polarity):
            then, now = getattr(was, polarity), getattr(state, polarity)
            if len(then) == len(now):
                for old, new in zip(then, now, strict=True):
                    known.setdefault((polarity, new), known.get((polarity, old)))
            elif new := [point for point in now if (polarity, point) not in known]:
                added[polarity] = new
        for polarity, points in added.items():
            known.update(dict.fromkeys([(polarity, point) for point in points], self._judged(was, polarity, points)))
        if len(added) == len(get_args(Polarity)):
            self._drawn[state.id] = _drawn(was, added)

    def _judged(self, was: ClassState, polarity: Polarity, added: Sequence[Point]) -> Correction | None:
        """Points that were added to a class in one step, by what is shown of it; None where they correct nothing of that."""
        volume, content = self._parameters.volume, self._volume.content
        shown, cells = (maps.get(was.id) for maps in (self._proxy.maps, self._proxy.low_maps))
        if volume is None or content is None or shown is None or cells is None or not was.visible or was.close_up is not None:
            return None
        if self._proxy.phase != "ready" or not self._proxy.up_to_date or self._volume.changed:
            return None
        depth_mm = float(cells.geometry.spacing_mm.max())
        points = world_to_local(volume, np.array(added))
        on_it = polarity == "positive"
        gross = any(corrects_grossly(shown, content.geometry, point, on_it, depth_mm) for point in points)
        return Correction(self._step, gross)

    def _reason(self, state: ClassState) -> CloserLookReason | None:
        known = self._known.get(state.id, {})
        corrections = {placed: correction for placed in _placed(state) if (correction := known.get(placed)) is not None}
        gross = {correction.step for correction in corrections.values() if correction.gross}
        if _needed_large_corrections(corrections, gross):
            return "large corrections"
        if self._is_small(state, {placed for placed, correction in corrections.items() if correction.step in gross}):
            return "small drawing"
        return None

    def _is_small(self, state: ClassState, gross: Set[Placed]) -> bool:
        """Whether a class's last diameter or outline is there and small, and all points since are `gross` corrections."""
        cells, drawn, placed = self._proxy.low_maps.get(state.id), self._drawn.get(state.id), set(_placed(state))
        if cells is None or drawn is None or drawn.begins or not drawn.points <= placed:
            return False
        points = np.array([point for _, point in drawn.points])
        return is_small(points, cells.geometry.spacing_mm.max()) and placed - drawn.before - drawn.points <= gross

    def _unasked_close_up(self, state: ClassState) -> CloseUp | None:
        """The box of a class that begins with a small outline and is shown as something else; None: it stays in the whole."""
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

    def _may_have_box(self, id_: str) -> bool:
        """Whether a class's box is small enough, by its newest map; while a map is awaited, by the one before."""
        cells, request, content = self._proxy.low_maps.get(id_), self._maps.requests.of(id_), self._volume.content
        if cells is None or request is None or content is None:
            return False
        judged, has_box = self._boxes.get(id_, (None, False))
        if judged is not cells and self._proxy.up_to_date:
            try:
                close_up_of(cells, request.positive, content.geometry)
                has_box = True
            except InputError:
                has_box = False
            self._boxes[id_] = cells, has_box
        return has_box


def _needed_large_corrections(corrections: Mapping[Placed, Correction], gross: Collection[int]) -> bool:
    """By the corrections of a class, and which of their steps were gross."""
    surplus = [of.step for (polarity, _), of in corrections.items() if of.gross and polarity == "negative"]
    if len(gross) < ENOUGH or not surplus:
        return False
    slight = {correction.step for correction in corrections.values()} - set(gross)
    return max(slight, default=0) < max(sorted(gross)[ENOUGH - 1], min(surplus))


def _drawn(was: ClassState, added: Mapping[Polarity, Sequence[Point]]) -> Drawn:
    """What added points on and off a class in one step."""
    placed = frozenset((polarity, point) for polarity, points in added.items() for point in points)
    return Drawn(placed, frozenset(_placed(was)))


def _placed(state: ClassState) -> Iterator[Placed]:
    for polarity in get_args(Polarity):
        for point in getattr(state, polarity):
            yield polarity, point
