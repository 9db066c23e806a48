"""A volume that is segmented in the compute process: what was asked for, what has arrived, and what is to be asked next.

Nothing here waits. Maps are asked for at once after each change of the annotations, and a change overtakes a refinement that is
still running. `poll`, called often, takes replies in and sends what has become due: refined maps when the user pauses, say.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal

from ..core.class_map import ClassMap
from ..core.class_request import ClassRequest
from ..core.close_up import CloseUp
from ..core.errors import InputError
from ..core.progress import SEGMENTING, WorkProgress
from ..rendering.structure_volume import StructureVolume
from ..session.feature_estimate import FeatureEstimate
from ..session.settings import SessionSettings
from .answered_maps import AnsweredMaps
from .client import ComputeClient
from .pending_requests import PendingRequests
from .requests import (
    CoarseFeatures,
    ComputeMaps,
    Done,
    Extract,
    Failed,
    FirstMap,
    GivenUp,
    Labels,
    LookCloser,
    Maps,
    MeasureMaps,
    Prepare,
    Progressed,
    RefinedMaps,
    RefineMaps,
    Refinement,
    ReleaseVolume,
    Render,
    RenderingMode,
    SegmentClasses,
    Taken,
    TakeVolume,
    Volumes,
)

Phase = Literal["no volume", "no features", "extracting", "ready"]
Event = Literal["state", "first map", "maps", "volumes", "refined", "rendering", "labels"]
"""What a poll can bring: phase, progress, estimate or an error; S_L of the class that is waited for; of all; how large segments
are by them; S_H; a volume of structures; a label map."""

Casting = Mapping[str, bool]
"""By class id, whether it casts shadows in 3D; classes that are missing do not."""

CloseUps = tuple[tuple[str, CloseUp], ...]
"""The close-ups that are asked for, by class id."""

RENDER_AFTER_S = 0.05
REFINE_AFTER_S = 0.4
"""How long the annotations must have been left alone before they are rendered in 3D, and before maps are refined: what runs
then slows the answer to the next click."""
OVERTAKE_AFTER_S = 0.5
"""How long the answer to one change of the annotations may take before the next change gives it up: that of many new points at
once. It is not given up sooner, so that answers come while changes follow each other quickly."""

_WAITED_FOR = (Extract, LookCloser, SegmentClasses)
"""Requests whose progress is shown. A refinement after a click is quick, and the user does not wait for it."""


class SegmentationProxy:
    """One volume at a time, in a compute process that is started when it is first needed, or ahead by `start`.

    Args:
        start_client: starts the compute process.
        may_start: whether that would be of any use; as long as it is not, nothing is started, and nobody told of it.

    Attributes:
        phase: how far the volume is.
        voxels: the digest of the volume's (`Taken`); empty until known.
        usable: whether maps can be had: once features are ready, or while they still become finer.
        estimate: what its features will cost; None until known.
        progress: of the running work; None where nothing runs that takes long.
        awaiting_close_ups: ids of the classes whose `low_maps` are of the whole volume until their close-ups are there.
        rendering: for the 3D views; None until there is one.
        rendered: ids of the classes in it, in the order of their numbers.
        labels: label map (K, J, I) of the last `segment`, and the ids of the classes that its labels 1, 2, … stand for.
    """

    def __init__(self, start_client: Callable[[], ComputeClient], may_start: Callable[[], bool] = lambda: True) -> None:
        self._pending = PendingRequests(start_client)
        self._may_start = may_start
        self._volume: TakeVolume | None = None
        self._settings = SessionSettings()
        self._classes: tuple[ClassRequest, ...] = ()
        self._first = ""
        self._refinement: Refinement | None = None
        self._look: tuple[RenderingMode, Casting, bool] | None = None
        self._maps_due = self._close_ups_due = self._volumes_due = False
        self._declined: CloseUps = ()
        self._rendering_due_s: float | None = None
        self._render_from_s = 0.0
        self._refine_due_s: float | None = None
        self._overtaken_from_s = 0.0
        self._started_s = 0.0
        self._error: str | None = None
        self._handlers: dict[tuple[type, type], Callable[[Any, Any], set[Event]]] = {
            (TakeVolume, Taken): self._on_taken,
            (ReleaseVolume, Done): lambda request, reply: set(),
            (Prepare, FeatureEstimate): self._on_estimate,
            (Extract, Done): self._on_features,
            (LookCloser, Done): self._on_close_ups,
            (ComputeMaps, Maps): self._on_maps,
            (MeasureMaps, Volumes): self._on_volumes,
            (RefineMaps, RefinedMaps): self._on_refined_maps,
            (Render, StructureVolume): self._on_rendering,
            (SegmentClasses, Labels): self._on_labels,
        }
        self._reset()

    def _reset(self) -> None:
        self.phase: Phase = "no volume" if self._volume is None else "no features"
        self.voxels = ""
        self.usable = False
        self.estimate: FeatureEstimate | None = None
        self.progress: WorkProgress | None = None
        self._answers = AnsweredMaps()
        self.rendering: StructureVolume | None = None
        self.rendered: tuple[str, ...] = ()
        self._rendered: tuple[str, ...] = ()
        self.labels: tuple[Labels, list[str]] | None = None
        self._maps_due, self._volumes_due, self._refine_due_s = True, False, None
        self.awaiting_close_ups: tuple[str, ...] = ()
        self._close_ups_due, self._declined = False, ()
        self._refused = False

    def start(self) -> None:
        """Start the compute process, so that it is ready when a volume is opened. Where that fails, `open` tells why."""
        if self._may_start():
            with suppress(InputError):
                self._pending.start()

    def open(self, volume: TakeVolume | None, settings: SessionSettings) -> None:
        """Take up a volume, or none. Cached features load at once."""
        self._pending.give_up(object)
        before, self._volume, self._settings = self._volume, volume, settings
        self._reset()
        if volume is not None and self._started():
            self._pending.ask(volume)
            self._pending.ask(Prepare(settings))
        elif before is not None and self._pending.started:
            # The process goes on, ready for the next one; gigabytes of this one are not to wait for that.
            self._pending.ask(ReleaseVolume())

    def extract(self) -> None:
        """Begin to compute the features."""
        if self.phase != "no features" or self._volume is None:
            return
        if not self._pending.started or self._refused:
            # The process was lost, and everything has to be sent again; or what was refused may be there by now.
            self.open(self._volume, self._settings)
            if not self._pending.started:
                return
        self.phase = "extracting"
        self.progress = WorkProgress(0, 0, "Starting", None)
        self._pending.ask(Extract())

    def cancel(self) -> None:
        """Stop what runs: the extraction; or a segmentation, whose labels are dropped even if they are on their way already.

        Close-ups stop where the classes of an `update` no longer ask for them.
        """
        if self._pending.has(SegmentClasses):
            self._pending.give_up(SegmentClasses)
            self.progress = None
        else:
            self._pending.cancel(Extract)

    def update(self, classes: Sequence[ClassRequest], refinement: Refinement | None, first: str = "") -> None:
        """The annotations have changed: ask for maps of these classes; and for refined ones, where `refinement` says how.

        Where they differ in iso values and sizes alone, `maps` follow at once. The class with the id `first`, if there is one,
        is answered before the others.
        """
        if not set(_close_ups(self._classes)) <= set(_close_ups(classes)) and self._pending.has(LookCloser):
            self._pending.give_up(LookCloser)
            self.progress = None
        self._classes, self._refinement, self._first = tuple(classes), refinement, first
        self._maps_due, self._refine_due_s = True, None
        self._render_from_s = time.monotonic() + RENDER_AFTER_S
        self._answers.resize(self._classes)
        self._send_due()

    def look(self, mode: RenderingMode | None, casting: Casting, surroundings: bool = False) -> None:
        """Choose what the 3D views are to show; None: nothing. See `Render`; classes that `casting` lacks cast no shadows."""
        look = (mode, casting, surroundings) if mode is not None else None
        if look != self._look:
            self._look, self._rendering_due_s = look, time.monotonic()
            if look is None:
                self.rendering = None

    def segment(self, refinement: Refinement) -> None:
        """Ask for a label map of the classes of the last `update`."""
        self.progress = WorkProgress(0, 0, SEGMENTING, None)
        self._pending.ask(SegmentClasses(self._classes, refinement))

    @property
    def maps(self) -> Mapping[str, ClassMap]:
        """By class id, S_H where there are, else S_L; see `AnsweredMaps`."""
        return self._answers.maps

    @property
    def refined(self) -> tuple[bool, ...]:
        """Of each of `maps`, whether it is S_H."""
        return self._answers.refined

    @property
    def low_maps(self) -> Mapping[str, ClassMap]:
        """By class id, S_L, also where `maps` are refined."""
        return self._answers.low_maps

    @property
    def volumes_ml(self) -> Mapping[str, float]:
        """By class id, of the segment that the class gets by `maps`, millilitres; a moment later than these."""
        return self._answers.volumes_ml

    @property
    def looks_closer(self) -> bool:
        """Whether it is close-ups that `progress` is of."""
        return self._pending.has(LookCloser) and not self._pending.has(SegmentClasses)

    @property
    def busy(self) -> bool:
        """Whether anything is under way or due."""
        if not self.usable:
            return bool(self._pending)
        due = (
            self._maps_due
            or self._close_ups_due
            or self._volumes_due
            or self._refine_due_s is not None
            or self._rendering_wanted
        )
        return bool(self._pending) or due

    @property
    def up_to_date(self) -> bool:
        """Whether `maps` are those of the last `update`."""
        return not self._maps_due and not self._pending.has(ComputeMaps)

    @property
    def first_up_to_date(self) -> bool:
        """Whether that of the class that is waited for is."""
        return self.up_to_date or (not self._maps_due and self._answers.first_came)

    @property
    def awaits_maps(self) -> bool:
        """Whether the answer to a click is under way."""
        return self._pending.has(ComputeMaps)

    @property
    def awaits_views(self) -> bool:
        """Whether the answer to a click is under way, or what 3D views show of it, unless that has to wait for other work."""
        rendering_next = self._rendering_wanted and not self._pending.has_other_than(MeasureMaps)
        return self.awaits_maps or rendering_next or self._pending.has(Render)

    @property
    def pid(self) -> int | None:
        """The number of the compute process; None where none runs."""
        return self._pending.pid

    def take_error(self) -> str | None:
        """What went wrong since the last call, in words for the user."""
        error, self._error = self._error, None
        return error

    def poll(self) -> set[Event]:
        """Take in what has come, send what is due, and tell what is new."""
        events: set[Event] = set()
        if not self._pending.started:
            return events
        for request, reply in self._pending.replies():
            events |= self._receive(request, reply)
        self._send_due()
        if not self._pending.alive:
            self._lost()
            events.add("state")
        return events

    def close(self) -> None:
        """End the compute process."""
        self._pending.close()
        self._volume = None
        self._reset()

    def _started(self) -> bool:
        """Whether there is a process; if not yet, it is started now, where it may be."""
        if self._may_start():
            try:
                self._pending.start()
            except InputError as error:
                self._error = str(error)
        return self._pending.started

    def _send_due(self) -> None:
        """Send the most urgent of what is due; the others wait until it is done, so that they do not delay what comes then."""
        if not self.usable or not self._pending.started:
            return
        if self._maps_due:
            # Where no class is left, what was shown of the last one goes at once.
            if not self._classes or time.monotonic() >= self._overtaken_from_s:
                self._pending.give_up(ComputeMaps)
            if not self._pending.has(ComputeMaps):
                self._pending.give_up(MeasureMaps, RefineMaps, Render)
                self._send_maps()
        elif not self._pending.has_other_than(MeasureMaps):
            self._send_after_maps()

    def _send_after_maps(self) -> None:
        if self._close_ups_due:
            self._close_ups_due = False
            self.progress = WorkProgress(0, 0, "Looking closer", None)
            self._pending.ask(LookCloser(self._answers.low_classes))
            return
        if self._rendering_wanted and time.monotonic() >= (self._rendering_due_s or 0.0):
            self._send_rendering()
        if self._volumes_due:
            self._volumes_due = False
            annotated_alone = self._refinement is None or self._refinement.only_annotated_components
            self._pending.ask(MeasureMaps(self._answers.low_classes, annotated_alone))
        elif not self._pending and self._refine_due_s is not None and time.monotonic() >= self._refine_due_s:
            self._refine_due_s = None
            self._pending.ask(RefineMaps(self._classes, self._refinement or Refinement()))

    def _send_maps(self) -> None:
        self._maps_due = False
        if not self._classes:
            self._close_ups_due = self._volumes_due = False
            self._answers, self.rendering = AnsweredMaps(), None
            return
        self._answers.expect()
        several = len(self._classes) > 1 and self._first in [annotated.id for annotated in self._classes]
        self._pending.ask(ComputeMaps(self._classes, self._first if several else ""))
        self._overtaken_from_s = time.monotonic() + OVERTAKE_AFTER_S
        if self._refinement is not None:
            self._refine_due_s = time.monotonic() + REFINE_AFTER_S

    @property
    def _rendering_wanted(self) -> bool:
        return self._rendering_due_s is not None and self._look is not None and bool(self.maps)

    def _send_rendering(self) -> None:
        """Ask for the maps that are shown now as a volume of structures."""
        assert self._look is not None
        self._rendering_due_s = None
        mode, casting, surroundings = self._look
        self._rendered = tuple(self.maps)
        cast = tuple(casting.get(id_, False) for id_ in self.maps)
        self._pending.ask(Render(mode, self.refined, cast, surroundings))

    def _receive(self, request: Any, reply: Any) -> set[Event]:
        if isinstance(reply, CoarseFeatures):
            self.usable = self._maps_due = True
            return {"state"}
        if isinstance(reply, Progressed):
            return self._on_progress(request, reply)
        if isinstance(reply, FirstMap):
            return self._on_first_map(request, reply)
        if isinstance(request, _WAITED_FOR):
            self.progress = None
        if isinstance(reply, (GivenUp, Failed)):
            return self._on_nothing(request, reply)
        handler = self._handlers.get((type(request), type(reply)))
        if handler is None:
            answer = f"{type(reply).__name__} to {type(request).__name__}"
            return self._on_nothing(
                request, Failed(f"The computation in the background gave a wrong answer ({answer}). Try again.")
            )
        return handler(request, reply)

    def _on_progress(self, request: Any, reply: Progressed) -> set[Event]:
        if not isinstance(request, _WAITED_FOR):
            return set()
        if self.progress is None or self.progress.what != reply.what:
            self._started_s = time.monotonic()
        elapsed = time.monotonic() - self._started_s
        left = elapsed * (reply.total - reply.done) / reply.done if reply.done and elapsed > 1.0 else None
        self.progress = WorkProgress(reply.done, reply.total, reply.what, left)
        return {"state"}

    def _on_nothing(self, request: Any, reply: GivenUp | Failed) -> set[Event]:
        if isinstance(request, Extract):
            self.phase = "no features"
        elif isinstance(request, LookCloser):
            self._declined = _close_ups(request.classes)
        elif isinstance(request, TakeVolume):
            # What was asked about it next cannot be answered either.
            self.phase, self.progress = "no volume", None
            self._pending.forget()
        elif isinstance(request, Prepare):
            # So that the reason is not followed by another one, which says less.
            self._pending.give_up(Extract)
            self.phase, self.progress, self._refused = "no features", None, True
        if isinstance(reply, Failed):
            self._error = reply.message
        return {"state"}

    def _on_taken(self, request: TakeVolume, reply: Taken) -> set[Event]:
        self.voxels = reply.digest
        return {"state"}

    def _on_estimate(self, request: Prepare, reply: FeatureEstimate) -> set[Event]:
        self.estimate = reply
        if reply.cached and self.phase == "no features":
            self.extract()
        return {"state"}

    def _on_features(self, request: Extract, reply: Done) -> set[Event]:
        self.phase = "ready"
        self.usable = self._maps_due = True
        return {"state"}

    def _on_close_ups(self, request: LookCloser, reply: Done) -> set[Event]:
        self._maps_due = True
        return {"state"}

    def _on_first_map(self, request: ComputeMaps, reply: FirstMap) -> set[Event]:
        self._answers.take_first(request, reply)
        return {"first map"}

    def _on_maps(self, request: ComputeMaps, reply: Maps) -> set[Event]:
        self._answers.take(request, reply, refining=self._refinement is not None)
        self._rendering_due_s, self._volumes_due = self._render_from_s, True
        self.awaiting_close_ups = reply.awaiting_close_ups
        wanted = bool(reply.awaiting_close_ups) and self.phase == "ready"
        self._close_ups_due = wanted and _close_ups(request.classes) != self._declined
        # It may be the answer to what the user has scrolled past.
        self._answers.resize(self._classes)
        return {"maps"}

    def _on_volumes(self, request: MeasureMaps, reply: Volumes) -> set[Event]:
        self._answers.take_volumes(request, reply)
        return {"volumes"}

    def _on_refined_maps(self, request: RefineMaps, reply: RefinedMaps) -> set[Event]:
        self._answers.take_refined(request, reply)
        self._rendering_due_s = time.monotonic()
        return {"refined"}

    def _on_rendering(self, request: Render, reply: StructureVolume) -> set[Event]:
        self.rendering, self.rendered = reply, self._rendered
        return {"rendering"}

    def _on_labels(self, request: SegmentClasses, reply: Labels) -> set[Event]:
        self.labels = reply, [annotated.id for annotated in request.classes]
        return {"labels"}

    def _lost(self) -> None:
        """The process died: out of memory, say. Whatever it held can be computed anew."""
        last = self._pending.last_words()
        self._pending.close()
        self._reset()
        if self._volume is None:
            return  # It had been started ahead, and nothing is lost.
        self._error = (
            "The computation in the background ended unexpectedly"
            f"{f' ({last})' if last else ', perhaps because the computer ran out of memory'}. Your structures and points "
            "are kept. Compute the features again; if it happens again, choose a faster preset, a smaller grid or another "
            "device under Advanced."
        )


def _close_ups(classes: Sequence[ClassRequest]) -> CloseUps:
    return tuple((request.id, request.close_up) for request in classes if request.close_up is not None)
