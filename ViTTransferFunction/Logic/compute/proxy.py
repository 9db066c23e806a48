"""The front end's side of a volume that is segmented in the compute process: its state and its results.

Nothing here blocks. `poll`, called often, receives replies and sends requests that have become due (`DueRequests`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal

from ..core.classes.class_map import ClassMap
from ..core.classes.class_request import ClassRequest
from ..core.system.errors import InputError
from ..core.system.progress import SEGMENTING, WorkProgress
from ..rendering.structure_volume import StructureVolume
from ..session.feature_estimate import FeatureEstimate
from ..session.settings import SessionSettings
from .answered_maps import AnsweredMaps
from .client import NO_ROOM, ComputeClient
from .due_requests import Casting, DueRequests
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
    Loaded,
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
"""What has changed in a `poll`. "state": phase, progress, estimate or an error; "first map": S_L of the class that is awaited
first; "maps": S_L of all classes; "volumes": the volumes of their segments; "refined": S_H; "rendering": a volume of structures
for the 3D views; "labels": a label map."""

_WAITED_FOR = {Extract: "Starting", LookCloser: "Looking closer", SegmentClasses: SEGMENTING}
"""Requests whose progress is shown, and the text that is shown until the first report of progress. A refinement after a click
is not among them, because it is fast and the user does not wait for it."""


class SegmentationProxy:
    """Segments one volume at a time in a compute process, which is started when it is first needed, or earlier by `start`.

    Args:
        start_client: starts the compute process.
        may_start: whether the process would be able to compute; while it is not, it is not started, and there is no error.

    Attributes:
        phase: the state of the volume.
        voxels: digest of the volume's voxels (`Taken`); empty until known.
        usable: whether maps can be computed: when features are complete, or from coarse features while they are refined.
        not_kept: why its features or a close-up's will have to be computed again next time, as a message to the user; empty if
            all are kept.
        estimate: estimated cost of the features; None until known.
        progress: progress of the running work; None if none runs that takes long.
        awaiting_close_ups: ids of the classes whose `low_maps` are of the whole volume until their close-ups are made.
        rendering: the volume of structures for the 3D views; None until there is one.
        rendered: ids of the classes in `rendering`, in the order of their numbers.
    """

    def __init__(self, start_client: Callable[[], ComputeClient], may_start: Callable[[], bool] = lambda: True) -> None:
        self._pending = PendingRequests(start_client)
        self._answers = AnsweredMaps()
        self._due = DueRequests(self._pending, self._answers)
        self._may_start = may_start
        self._volume: TakeVolume | None = None
        self._settings = SessionSettings()
        self._started_s = 0.0
        self._error: str | None = None
        self._handlers: dict[tuple[type, type], Callable[[Any, Any], set[Event]]] = {
            (TakeVolume, Taken): self._on_taken,
            (ReleaseVolume, Done): lambda request, reply: set(),
            (Prepare, FeatureEstimate): self._on_estimate,
            (Extract, Loaded): self._on_features,
            (LookCloser, Loaded): self._on_close_ups,
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
        self.not_kept = ""
        self.estimate: FeatureEstimate | None = None
        self.progress: WorkProgress | None = None
        self._answers.forget()
        self._due.restart()
        self.rendering: StructureVolume | None = None
        self.rendered: tuple[str, ...] = ()
        self._rendered: tuple[str, ...] = ()
        self._labels: tuple[Labels, list[str]] | None = None
        self.awaiting_close_ups: tuple[str, ...] = ()
        self._refused = False
        self._loads_at_once = True

    def start(self) -> None:
        """Start the compute process, so that it is ready when a volume is opened. If this fails, `open` reports the reason."""
        if self._may_start():
            with suppress(InputError):
                self._pending.start()

    def open(self, volume: TakeVolume | None, settings: SessionSettings) -> None:
        """Open a volume, or none (None). Cached features are loaded immediately."""
        self._pending.give_up(object)
        before, self._volume, self._settings = self._volume, volume, settings
        self._reset()
        if volume is not None and self._started():
            self._pending.ask(volume)
            self._pending.ask(Prepare(settings))
        elif before is not None and self._pending.started:
            # The process is kept for the next volume, but must not hold gigabytes of this one until then.
            self._pending.ask(ReleaseVolume())

    def extract(self) -> None:
        """Start computing the features."""
        if self.phase != "no features" or self._volume is None:
            return
        if not self._pending.started or self._refused:
            # The process was lost, so that everything has to be sent again; or the cause of a refusal may be gone by now.
            self.open(self._volume, self._settings)
            if not self._pending.started:
                return
        self.phase = "extracting"
        self._ask(Extract())

    def cancel(self) -> None:
        """Cancel a segmentation, whose labels are discarded even if they are already on their way; or else the extraction.

        Close-ups are cancelled by an `update` with classes that have no such close-up.
        """
        if self._pending.has(SegmentClasses):
            self._pending.give_up(SegmentClasses)
            self.progress = None
        else:
            self._pending.cancel(Extract)

    def update(self, classes: Sequence[ClassRequest], refinement: Refinement | None, first: str = "") -> None:
        """Request maps after a change of the annotations.

        If only iso values and sizes have changed, `maps` change immediately.

        Args:
            classes: the classes.
            refinement: how maps are refined; None: they are not.
            first: id of the class whose map is wanted before the others, if there is one with this id.
        """
        if self._due.drops_close_up(classes) and self._pending.has(LookCloser):
            self._pending.give_up(LookCloser)
            self.progress = None
        self._due.update(classes, refinement, first)
        if not classes:
            self.rendering = None
        self._answers.resize(self._due.classes)
        self._send_due()

    def look(self, mode: RenderingMode | None, casting: Casting, surroundings: bool = False) -> None:
        """Choose what the 3D views show (see `Render`); None: nothing. Classes missing from `casting` cast no shadows."""
        look = (mode, casting, surroundings) if mode is not None else None
        if look != self._due.look:
            self._due.change_look(look)
            if look is None:
                self._pending.give_up(Render)
                self.rendering = None

    @property
    def failed_close_ups(self) -> tuple[str, ...]:
        """Ids of the classes whose maps are of the whole volume, because their close-ups could not be made."""
        return self.awaiting_close_ups if self._due.declines else ()

    def try_close_ups_again(self) -> None:
        """Request close-ups again that could not be made before."""
        self._due.try_close_ups_again()

    def segment(self, refinement: Refinement) -> None:
        """Request a label map of the classes of the last `update`."""
        self._ask(SegmentClasses(self._due.classes, refinement))

    @property
    def maps(self) -> Mapping[str, ClassMap]:
        """S_H if there is one, else S_L, by class id; see `AnsweredMaps`."""
        return self._answers.maps

    @property
    def refined(self) -> tuple[bool, ...]:
        """For each of `maps`, whether it is S_H."""
        return self._answers.refined

    @property
    def low_maps(self) -> Mapping[str, ClassMap]:
        """S_L by class id, also if `maps` has S_H."""
        return self._answers.low_maps

    @property
    def volumes_ml(self) -> Mapping[str, float]:
        """Volume of the segment that results from `maps`, in millilitres, by class id; available shortly after the maps."""
        return self._answers.volumes_ml

    @property
    def looks_closer(self) -> bool:
        """Whether `progress` is the progress of close-ups."""
        return self._pending.has(LookCloser) and not self._pending.has(SegmentClasses)

    @property
    def busy(self) -> bool:
        """Whether a request is pending or due."""
        return bool(self._pending) or (self.usable and bool(self._due))

    @property
    def up_to_date(self) -> bool:
        """Whether `maps` belong to the last `update`."""
        return not self._due.maps_due and not self._pending.has(ComputeMaps)

    @property
    def first_up_to_date(self) -> bool:
        """The same for the map of class `first` of the last `update`."""
        return self.up_to_date or (not self._due.maps_due and self._answers.first_came)

    @property
    def awaits_maps(self) -> bool:
        """Whether maps have been requested and have not arrived."""
        return self._pending.has(ComputeMaps)

    @property
    def awaits_views(self) -> bool:
        """Whether maps or the rendering of the 3D views are on their way, unless the rendering has to wait for other work."""
        rendering_next = self._due.rendering_wanted and not self._pending.has_other_than(MeasureMaps)
        return self.awaits_maps or rendering_next or self._pending.has(Render)

    @property
    def pid(self) -> int | None:
        """The process id of the compute process; None if none runs."""
        return self._pending.pid

    def take_error(self) -> str | None:
        """The error since the last call, as a message to the user; None if there was none."""
        error, self._error = self._error, None
        return error

    def take_labels(self) -> tuple[Labels, list[str]] | None:
        """The result of `segment` if it has arrived since the last call: labels, and ids of the classes 1, 2, … in them."""
        labels, self._labels = self._labels, None
        return labels

    def poll(self) -> set[Event]:
        """Receive replies, send requests that are due, and return what has changed."""
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
        """Whether there is a process; if there is none, it is started if that is allowed."""
        if self._may_start():
            try:
                self._pending.start()
            except InputError as error:
                self._error = str(error)
        return self._pending.started

    def _send_due(self) -> None:
        if not self.usable or not self._pending.started:
            return
        for request in self._due.take():
            if isinstance(request, Render):
                self._rendered = tuple(self.maps)
            self._ask(request)

    def _ask(self, request: Any) -> None:
        if type(request) in _WAITED_FOR:
            self.progress = WorkProgress(0, 0, _WAITED_FOR[type(request)], None)
        self._pending.ask(request)

    def _receive(self, request: Any, reply: Any) -> set[Event]:
        if isinstance(reply, CoarseFeatures):
            return self._on_usable()
        if isinstance(reply, Progressed):
            return self._on_progress(request, reply)
        if isinstance(reply, FirstMap):
            return self._on_first_map(request, reply)
        if type(request) in _WAITED_FOR:
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
        if type(request) not in _WAITED_FOR:
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
            if isinstance(reply, Failed) and self.estimate is not None and self.estimate.cached:
                # The cached features are unusable. Users see the cost of new ones before they compute them.
                self.estimate, self._loads_at_once = None, False
                self._pending.ask(Prepare(self._settings))
        elif isinstance(request, LookCloser):
            self._due.decline(request)
        elif isinstance(request, TakeVolume):
            # Requests that were sent after it cannot be answered either.
            self.phase, self.progress = "no volume", None
            self._pending.forget()
        elif isinstance(request, Prepare):
            # The extraction would fail for the same reason, with a less specific message.
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
        if reply.cached and self._loads_at_once and self.phase == "no features":
            self.extract()
        return {"state"}

    def _on_features(self, request: Extract, reply: Loaded) -> set[Event]:
        self.phase, self.not_kept = "ready", reply.not_kept
        return self._on_usable()

    def _on_usable(self) -> set[Event]:
        self.usable = True
        self._due.features_came()
        return {"state"}

    def _on_close_ups(self, request: LookCloser, reply: Loaded) -> set[Event]:
        self.not_kept = reply.not_kept
        self._due.features_came()
        return {"state"}

    def _on_first_map(self, request: ComputeMaps, reply: FirstMap) -> set[Event]:
        self._answers.take_first(request, reply)
        return {"first map"}

    def _on_maps(self, request: ComputeMaps, reply: Maps) -> set[Event]:
        self._answers.take(request, reply, refining=self._due.refinement is not None)
        self.awaiting_close_ups = reply.awaiting_close_ups
        self._due.maps_came(request, may_look_closer=bool(reply.awaiting_close_ups) and self.phase == "ready")
        # The user may have changed sizes or iso values since these maps were requested.
        self._answers.resize(self._due.classes)
        return {"maps"}

    def _on_volumes(self, request: MeasureMaps, reply: Volumes) -> set[Event]:
        self._answers.take_volumes(request, reply)
        return {"volumes"}

    def _on_refined_maps(self, request: RefineMaps, reply: RefinedMaps) -> set[Event]:
        self._answers.take_refined(request, reply)
        self._due.refined_maps_came()
        return {"refined"}

    def _on_rendering(self, request: Render, reply: StructureVolume) -> set[Event]:
        self.rendering, self.rendered = reply, self._rendered
        return {"rendering"}

    def _on_labels(self, request: SegmentClasses, reply: Labels) -> set[Event]:
        self._labels = reply, [annotated.id for annotated in request.classes]
        if self.awaiting_close_ups:
            # Close-ups that could not be made for the maps were made for the labels; the maps shown have to match these.
            self._due.features_came()
        return {"labels"}

    def _lost(self) -> None:
        """Handle the death of the process, perhaps for lack of memory. All that it held can be computed again."""
        last = self._pending.last_words()
        self._pending.close()
        self._reset()
        if self._volume is None:
            return  # It was started before there was a volume, so nothing is lost.
        again = (
            "Free some space on the disk with the temporary files, then compute the features again."
            if last.startswith(NO_ROOM)
            else "Compute the features again; if it happens again, choose a faster preset, a smaller grid or another device "
            "under Advanced."
        )
        self._error = (
            "The computation in the background ended unexpectedly"
            f"{f' ({last})' if last else ', perhaps because the computer ran out of memory'}. Your structures and points "
            f"are kept. {again}"
        )
