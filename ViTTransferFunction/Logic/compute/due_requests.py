"""What is to be asked about the classes next: the most urgent first, and each only when it delays nothing more urgent.

Maps are due at once after each change of the annotations, and a change overtakes a refinement that is still running. Once they
are there, what follows from them is due: close-ups, the rendering in 3D, how large segments are, and refined maps when the user
pauses.
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
"""By class id, whether it casts shadows in 3D; classes that are missing do not."""

Look = tuple[RenderingMode, Casting, bool]
"""What the 3D views are to show, see `Render`: the last one says whether surroundings are wanted."""

CloseUps = tuple[tuple[str, CloseUp], ...]
"""The close-ups that are asked for, by class id."""

RENDER_AFTER_S = 0.05
REFINE_AFTER_S = 0.4
"""How long the annotations must have been left alone before they are rendered in 3D, and before maps are refined: what runs
then slows the answer to the next click."""
OVERTAKE_AFTER_S = 0.5
"""How long the answer to one change of the annotations may take before the next change gives it up: that of many new points at
once. It is not given up sooner, so that answers come while changes follow each other quickly."""


class DueRequests:
    """Decides what is asked, and when; true while something is to be asked, now or later.

    `PendingRequests` has what was asked, `AnsweredMaps` what has come.

    Args:
        pending: is waited for, or given up for what is more urgent.
        answers: to what was asked.

    Attributes:
        classes: of the last `update`.
        refinement: how their maps are to be refined; None: they are not.
        look: of the 3D views; None: they show nothing.
        maps_due: whether maps of these classes are still to be asked for.
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
        """Nothing was asked: the volume is another one, or the process."""
        self.maps_due, self._volumes_due = True, False
        self._refine_due_s: float | None = None
        self._close_ups_due = False
        self._declined: CloseUps = ()

    def update(self, classes: Sequence[ClassRequest], refinement: Refinement | None, first: str) -> None:
        """The annotations have changed. The class with the id `first`, if there is one, is to be answered before the others."""
        self.classes, self.refinement, self._first = tuple(classes), refinement, first
        self.maps_due, self._refine_due_s = True, None
        self._render_from_s = time.monotonic() + RENDER_AFTER_S

    def change_look(self, look: Look | None) -> None:
        """The 3D views are to show something else."""
        self.look, self._rendering_due_s = look, time.monotonic()

    def take(self) -> list[Any]:
        """The requests that are due by now, to be asked in this order. What must not delay them is given up."""
        if self.maps_due:
            return self._take_maps()
        # All else waits for what was asked before, so that it does not delay what comes then.
        return [] if self._pending.has_other_than(MeasureMaps) else self._take_after_maps()

    def features_came(self) -> None:
        """There are other features than those that maps were made of: of the volume, or of close-ups."""
        self.maps_due = True

    def maps_came(self, request: ComputeMaps, may_look_closer: bool) -> None:
        """Maps are there. `may_look_closer`: some are of the whole volume for lack of close-ups, and these can be made now."""
        self._rendering_due_s, self._volumes_due = self._render_from_s, True
        self._close_ups_due = may_look_closer and _close_ups(request.classes) != self._declined

    def refined_maps_came(self) -> None:
        """They are there, and rendered at once."""
        self._rendering_due_s = time.monotonic()

    def decline(self, request: LookCloser) -> None:
        """Close-ups could not be made: these are not asked for again by themselves."""
        self._declined = _close_ups(request.classes)

    @property
    def declines(self) -> bool:
        """Whether close-ups could not be made that are still wanted as they were then."""
        return bool(self._declined) and self._declined == _close_ups(self.classes)

    def try_close_ups_again(self) -> None:
        """The user asks again for close-ups that could not be made: what was in the way may be gone."""
        if self._declined:
            self._declined, self.maps_due = (), True

    def drops_close_up(self, classes: Sequence[ClassRequest]) -> bool:
        """Whether a close-up that was asked for by the last `update` is not by these classes."""
        return not set(_close_ups(self.classes)) <= set(_close_ups(classes))

    @property
    def rendering_wanted(self) -> bool:
        """Whether the 3D views are to be asked for, now or later."""
        return self._rendering_due_s is not None and self.look is not None and bool(self._answers.maps)

    def _take_maps(self) -> list[Any]:
        # Where no class is left, what was shown of the last one goes at once.
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
        """Of the maps that are shown now."""
        assert self.look is not None
        self._rendering_due_s = None
        mode, casting, surroundings = self.look
        cast = tuple(casting.get(id_, False) for id_ in self._answers.maps)
        return Render(mode, self._answers.refined, cast, surroundings)


def _close_ups(classes: Sequence[ClassRequest]) -> CloseUps:
    return tuple((request.id, request.close_up) for request in classes if request.close_up is not None)
