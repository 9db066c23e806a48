"""Which structures a closer look may find better: those that needed large corrections in the whole scan, or are short in it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from ..compute.proxy import SegmentationProxy
from ..core.class_map import ClassMap
from ..core.close_up_choice import close_up_of
from ..core.diameter_points import last_diameter
from ..core.errors import InputError
from ..core.gross_correction import corrects_grossly
from .annotations import SceneAnnotations
from .class_requests import ClassRequests
from .class_state import ClassState, Polarity
from .opened_volume import OpenedVolume
from .parameters import SceneParameters
from .point_lists import Point
from .volume import world_to_local
from .wording import CloserLookReason

ENOUGH = 2
"""Gross corrections of a class, from which on a box is worth it on average; see `Benchmarks/results/candidates.md`."""

SHORT_CELLS = 4.0
"""A diameter of fewer cells is short. Of 25 such structures a box found more on average, but only the compact ones gained; see
`Benchmarks/results/candidates.md`, *A diameter instead of the first click*."""

Placed = tuple[Polarity, Point]
"""A point as a class has it."""


@dataclass(frozen=True)
class Correction:
    """What was placed in one step: a point, a stroke, or the points of a region or of a diameter.

    Attributes:
        step: later ones have higher numbers.
        gross: whether a point of it lay deep within what was wrong (`corrects_grossly`), more than a cell's edge.
    """

    step: int
    gross: bool


class CloseUpHints:
    """Keeps in mind how classes were corrected. Their diameters it finds among their points.

    A correction is judged once, when it is placed, by what is shown of the class until then. Points of which nothing was shown
    are no corrections: those of a saved scene or of another volume, of a class that is new, or placed before the answer to the
    ones before. A point that is moved, taken back or brought back stays what it was.

    None of what is kept in mind is saved: it speaks of what the user sees now.

    Args:
        parameters: say which volume.
        annotations: hold the classes.
        volume: is being looked at.
        proxy: has the maps that are shown.
    """

    def __init__(
        self, parameters: SceneParameters, annotations: SceneAnnotations, volume: OpenedVolume, proxy: SegmentationProxy
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._volume = volume
        self._proxy = proxy
        self._classes: dict[str, ClassState] = {}
        # None: it corrected nothing that was shown.
        self._known: dict[str, dict[Placed, Correction | None]] = {}
        self._looked_at: set[str] = set()
        self._boxes: dict[str, tuple[ClassMap, bool]] = {}
        self._step = 0

    def forget(self) -> None:
        """What is there now was not placed on what is shown from now on: scene or volume are others."""
        self._classes = {state.id: state for state in self._annotations.classes}
        self._known = {id_: dict.fromkeys(known) for id_, known in self._known.items()}
        for state in self._annotations.classes:
            self._known.setdefault(state.id, {}).update(dict.fromkeys(_placed(state)))
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

    def of(self, state: ClassState, requests: ClassRequests) -> CloserLookReason | None:
        """Why a class should be looked at closer, as far as one can tell; None: no reason is known, or it cannot be.

        Whether it is small, thin or compact, its user knows. Either reason holds only before its first close-up, and until a
        correction that is not gross:

        - "large corrections": from its second gross one on, one of which was off the structure: else it may be several like
          objects, clicked one after the other.
        - "short diameter": its last diameter is shorter than `SHORT_CELLS`.

        Args:
            state: of the class.
            requests: what was asked for last of the classes.
        """
        if self._proxy.phase != "ready" or state.id in self._looked_at:
            return None
        reason = self._reason(state)
        return reason if reason and self._may_have_box(state.id, requests) else None

    def _note_points(self, was: ClassState | None, state: ClassState) -> None:
        known = self._known.setdefault(state.id, {})
        if was is None:
            known.update({placed: known.get(placed) for placed in _placed(state)})
            return
        for polarity in get_args(Polarity):
            then, now = getattr(was, polarity), getattr(state, polarity)
            if len(then) == len(now):
                for old, new in zip(then, now, strict=True):
                    known.setdefault((polarity, new), known.get((polarity, old)))
            elif added := [point for point in now if (polarity, point) not in known]:
                known.update(dict.fromkeys([(polarity, point) for point in added], self._judged(was, polarity, added)))

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
        if self._is_short(state, {placed for placed, correction in corrections.items() if correction.step in gross}):
            return "short diameter"
        return None

    def _is_short(self, state: ClassState, gross: Collection[Placed]) -> bool:
        """Whether the last diameter of a class is short, and all points since are `gross` corrections."""
        cells = self._proxy.low_maps.get(state.id)
        diameter = last_diameter(*(np.array(points).reshape(-1, 3) for points in (state.positive, state.negative)))
        if cells is None or diameter is None or diameter.length_mm >= SHORT_CELLS * cells.geometry.spacing_mm.max():
            return False
        since: dict[Polarity, Sequence[Point]] = {
            "positive": state.positive[diameter.inside_until :],
            "negative": state.negative[diameter.outside_until :],
        }
        return all((polarity, point) in gross for polarity, points in since.items() for point in points)

    def _may_have_box(self, id_: str, requests: ClassRequests) -> bool:
        """Whether a class's box is small enough, by its newest map; while a map is awaited, by the one before."""
        cells, request, content = self._proxy.low_maps.get(id_), requests.of(id_), self._volume.content
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


def _placed(state: ClassState) -> Iterator[Placed]:
    for polarity in get_args(Polarity):
        for point in getattr(state, polarity):
            yield polarity, point
