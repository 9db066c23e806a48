"""Decides which request is sent to the compute process next: the most urgent first, and each only if it delays no other.

Maps are requested immediately after each change of the annotations; a refinement that is still running is cancelled. When the
maps have arrived, what depends on them is requested: close-ups, the 3D rendering, the volumes of segments, and refined maps
once the user pauses.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from ..core.classes.class_request import ClassRequest
from ..core.classes.close_up import CloseUp
from .answered_maps import AnsweredMaps
from .pending_requests import PendingRequests
from .requests import ComputeMaps, LookCloser, MeasureMaps, RefineMaps, Refinement, Render, RenderingMode

Casting = Mapping[str, bool]
"""Whether a class casts shadows in 3D, by class id; classes that are missing cast none."""

Look = tuple[RenderingMode, Casting, bool]
"""What the 3D views show, see `Render`; the last element says whether surroundings are shown."""

CloseUps = tuple[tuple[str, CloseUp], ...]
"""The requested close-ups, with their class ids."""

RENDER_AFTER_S = 0.05
REFINE_AFTER_S = 0.4
"""Time without changes of the annotations before they are rendered in 3D, and before maps are refined: these computations would
delay the answer to the next click."""
OVERTAKE_AFTER_S = 0.5
"""Time after which a change of the annotations cancels the request for maps of an earlier change, such as one with many new
points. It is not cancelled sooner, so that maps keep arriving during rapid changes."""


class DueRequests:
    """Decides which requests are sent, and when. True while a request is due, now or later.

    `PendingRequests` has the requests that were sent, `AnsweredMaps` the maps that have arrived.

    Args:
        pending: requests without an answer; given up in favour of more urgent ones.
        answers: the maps that have arrived.

    Attributes:
        classes: classes of the last `update`.
        refinement: how their maps are refined; None: they are not refined.
        look: what the 3D views show; None: nothing.
        maps_due: whether maps of these classes have still to be requested.
    """

    def __init__(self, pending: PendingRequests, answers: AnsweredMaps) -> None:
        self._pending = pending
        self._answers = answers
        self.classes: tuple[ClassRequest, ...] = ()
        self.refinement: Refinement | None = None
        self.look: Look | None = None
        self._first = ""
        self._render_from_s = self._overtaken_from_s = 0.0
        self._rendering_due_s: float | None = None
        self.restart()

    def __bool__(self) -> bool:
        return (
            self.maps_due or self._close_ups_due or self._volumes_due or self._refine_due_s is not None or self.rendering_wanted
        )

    def restart(self) -> None:
        """Forget all requests, because the volume or the compute process is another one."""
        self.maps_due, self._volumes_due = True, False
        self._refine_due_s: float | None = None
        self._close_ups_due = False
        self._declined: CloseUps = ()

    def update(self, classes: Sequence[ClassRequest], refinement: Refinement | None, first: str) -> None:
        """Note changed annotations; the map of the class with the id `first`, if there is one, comes before the others."""
        self.classes, self.refinement, self._first = tuple(classes), refinement, first
        self.maps_due, self._refine_due_s = True, None
        self._render_from_s = time.monotonic() + RENDER_AFTER_S

    def change_look(self, look: Look | None) -> None:
        """Note that the 3D views have to show something else."""
        self.look, self._rendering_due_s = look, time.monotonic()

    def take(self) -> list[Any]:
        """The requests that are due now, in the order in which to send them. Requests that would delay them are given up."""
        if self.maps_due:
            return self._take_maps()
        # All else waits for what was asked before, so that it does not delay what comes then.
        return [] if self._pending.has_other_than(MeasureMaps) else self._take_after_maps()

    def features_came(self) -> None:
        """Note that there are new features, of the volume or of close-ups: maps have to be computed again."""
        self.maps_due = True

    def maps_came(self, request: ComputeMaps, may_look_closer: bool) -> None:
        """Note the arrival of maps.

        Args:
            request: the request that they answer.
            may_look_closer: whether close-ups are missing that can be made now; their classes have maps of the whole volume.
        """
        self._rendering_due_s, self._volumes_due = self._render_from_s, True
        self._close_ups_due = may_look_closer and _close_ups(request.classes) != self._declined

    def refined_maps_came(self) -> None:
        """Note the arrival of refined maps, which are rendered immediately."""
        self._rendering_due_s = time.monotonic()

    def decline(self, request: LookCloser) -> None:
        """Note that close-ups could not be made, so that they are not requested again automatically."""
        self._declined = _close_ups(request.classes)

    @property
    def declines(self) -> bool:
        """Whether the current close-ups are those that could not be made."""
        return bool(self._declined) and self._declined == _close_ups(self.classes)

    def try_close_ups_again(self) -> None:
        """Allow close-ups that could not be made to be requested again, at the user's wish."""
        if self._declined:
            self._declined, self.maps_due = (), True

    def drops_close_up(self, classes: Sequence[ClassRequest]) -> bool:
        """Whether the last `update` has a close-up that these classes lack."""
        return not set(_close_ups(self.classes)) <= set(_close_ups(classes))

    @property
    def rendering_wanted(self) -> bool:
        """Whether a rendering of the 3D views is due, now or later."""
        return self._rendering_due_s is not None and self.look is not None and bool(self._answers.maps)

    def _take_maps(self) -> list[Any]:
        # If no class is left, the map of the last one is removed immediately.
        if not self.classes or time.monotonic() >= self._overtaken_from_s:
            self._pending.give_up(ComputeMaps)
        if self._pending.has(ComputeMaps):
            return []
        self._pending.give_up(MeasureMaps, RefineMaps, Render)
        self.maps_due = False
        if not self.classes:
            self._close_ups_due = self._volumes_due = False
            self._answers.forget()
            return []
        self._answers.expect()
        self._overtaken_from_s = time.monotonic() + OVERTAKE_AFTER_S
        if self.refinement is not None:
            self._refine_due_s = time.monotonic() + REFINE_AFTER_S
        several = len(self.classes) > 1 and self._first in [annotated.id for annotated in self.classes]
        return [ComputeMaps(self.classes, self._first if several else "")]

    def _take_after_maps(self) -> list[Any]:
        if self._close_ups_due:
            self._close_ups_due = False
            return [LookCloser(self._answers.low_classes)]
        taken: list[Any] = []
        if self.rendering_wanted and time.monotonic() >= (self._rendering_due_s or 0.0):
            taken.append(self._take_rendering())
        if self._volumes_due:
            self._volumes_due = False
            annotated_alone = self.refinement is None or self.refinement.only_annotated_components
            taken.append(MeasureMaps(self._answers.low_classes, annotated_alone))
        elif not (taken or self._pending) and self._refine_due_s is not None and time.monotonic() >= self._refine_due_s:
            self._refine_due_s = None
            taken.append(RefineMaps(self.classes, self.refinement or Refinement()))
        return taken

    def _take_rendering(self) -> Render:
        """The request to render the maps that are shown now."""
        assert self.look is not None
        self._rendering_due_s = None
        mode, casting, surroundings = self.look
        cast = tuple(casting.get(id_, False) for id_ in self._answers.maps)
        return Render(mode, self._answers.refined, cast, surroundings)


def _close_ups(classes: Sequence[ClassRequest]) -> CloseUps:
    return tuple((request.id, request.close_up) for request in classes if request.close_up is not None)
