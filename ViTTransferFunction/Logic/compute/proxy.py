"""A volume that is segmented in the compute process: what was asked for, what has arrived, and what is to be asked next.

Nothing here waits. `poll`, called often, takes replies in and sends what has become due: maps at once after each change of the
annotations, the refined ones when the user pauses. A new change overtakes a refinement that is still running.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..core.annotations import Color
from .client import ComputeClient
from .exchange import Estimate, Progressing, RemoteVolume, ShownMap
from .messages import Message

Phase = Literal["no volume", "no features", "extracting", "ready"]
Event = Literal["state", "maps", "refined", "rendering", "labels"]
"""What a poll can bring: phase, progress, estimate or an error; S_L; S_H; a volume of colours; a label map."""

RENDER_AFTER_S = 0.15
REFINE_AFTER_S = 0.4
"""How long the annotations must have been left alone before they are rendered in 3D, and before maps are refined: what runs
then slows the answer to the next click."""


_WAITED_FOR = ("extract", "segment")
"""Requests whose progress is shown. A refinement after a click is quick, and the user does not wait for it."""


@dataclass(frozen=True)
class _Asked:
    """A request that waits for its reply: of which kind, and about which classes."""

    what: str
    ids: list[str]


class RemoteSegmentation:
    """One volume at a time, in a compute process that is started when it is first needed.

    Args:
        start_client: starts the compute process.

    Attributes:
        phase: how far the volume is.
        usable: whether maps can be had: once features are ready, or while they still become finer.
        estimate: what its features will cost; None until known.
        progress: of the running work; None where nothing runs that takes long.
        maps: by class id; S_H where `refined`, else S_L.
        rendering: a volume of colours (K', J', I', 4) for the 3D views and its IJK-to-RAS matrix; None until there is one.
        labels: label map (K, J, I) of the last `segment`, and the ids of the classes that its labels 1, 2, … stand for.
    """

    def __init__(self, start_client: Callable[[], ComputeClient]) -> None:
        self._start_client = start_client
        self._client: ComputeClient | None = None
        self._volume: RemoteVolume | None = None
        self._settings: dict[str, Any] = {}
        self._pending: dict[int, _Asked] = {}
        self._classes: list[dict[str, Any]] = []
        self._refinement: dict[str, Any] = {}
        self._look: dict[str, Any] | None = None
        self._maps_due = False
        self._rendering_due_s: float | None = None
        self._refine_due_s: float | None = None
        self._started_s = 0.0
        self._error: str | None = None
        self._reset()

    def _reset(self) -> None:
        self.phase: Phase = "no volume" if self._volume is None else "no features"
        self.usable = False
        self.estimate: Estimate | None = None
        self.progress: Progressing | None = None
        self.maps: dict[str, ShownMap] = {}
        self.refined = False
        self.rendering: tuple[np.ndarray, np.ndarray] | None = None
        self.labels: tuple[np.ndarray, list[str]] | None = None
        self._pending.clear()
        self._maps_due, self._refine_due_s = True, None

    def open(self, volume: RemoteVolume | None, settings: dict[str, Any]) -> None:
        """Take up a volume, or none, with the arguments of `SegmentationService.prepare`. Cached features load at once."""
        self._give_up({asked.what for asked in self._pending.values()})
        self._volume, self._settings = volume, settings
        self._reset()
        if volume is not None:
            self._ask("volume", [volume.array], ijk_to_ras=volume.geometry.ijk_to_ras.tolist(), name=volume.name)
            self._ask("prepare", **settings)

    def extract(self) -> None:
        """Begin to compute the features."""
        if self.phase != "no features" or self._volume is None:
            return
        if self._client is None:
            # The process was lost; it has to be told everything again.
            self.open(self._volume, self._settings)
        self.phase = "extracting"
        self.progress = Progressing(0, 0, "Starting", None)
        self._ask("extract")

    def cancel(self) -> None:
        """Stop what runs: the extraction, or a segmentation."""
        if self._client is not None:
            self._client.cancel(number for number, asked in self._pending.items() if asked.what in _WAITED_FOR)

    def update(self, classes: Sequence[dict[str, Any]], refinement: dict[str, Any] | None) -> None:
        """The annotations have changed: ask for maps of these classes.

        Args:
            classes: of each its "id", and the fields of `AnnotatedClass`, without colour, as JSON has them.
            refinement: the further arguments of `SegmentationService.refine`; None: leave maps at low resolution.
        """
        self._classes, self._refinement = list(classes), refinement or {}
        self._maps_due, self._refine_due_s = True, None

    def look(self, rendering: str, styles: dict[str, tuple[Color, float]]) -> None:
        """Choose what the 3D views are to show.

        Args:
            rendering: "off", "similarity" or "transfer function".
            styles: by class id, its colour and its opacity in [0, 1]; classes that are missing are not shown.
        """
        look = {"rendering": rendering, "styles": styles} if rendering != "off" else None
        if look != self._look:
            self._look, self._rendering_due_s = look, time.monotonic()
            if look is None:
                self.rendering = None

    def segment(self, refinement: dict[str, Any]) -> None:
        """Ask for a label map of the classes of the last `update`."""
        self.progress = Progressing(0, 0, "Segmenting classes", None)
        self._ask_about_classes("segment", **refinement)

    @property
    def busy(self) -> bool:
        """Whether anything is under way or due."""
        if self.phase != "ready":
            return bool(self._pending)
        return bool(self._pending) or self._maps_due or self._refine_due_s is not None or self._rendering_wanted

    @property
    def up_to_date(self) -> bool:
        """Whether `maps` are those of the last `update`."""
        return not self._maps_due and all(asked.what != "maps" for asked in self._pending.values())

    @property
    def pid(self) -> int | None:
        """The number of the compute process; None where none runs."""
        return self._client.pid if self._client else None

    def take_error(self) -> str | None:
        """What went wrong since the last call, in words for the user."""
        error, self._error = self._error, None
        return error

    def poll(self) -> set[Event]:
        """Take in what has come, send what is due, and tell what is new."""
        events: set[Event] = set()
        if self._client is None:
            return events
        for reply in self._client.replies():
            events |= self._receive(reply)
        self._send_due()
        if not self._client.alive:
            self._lost()
            events.add("state")
        return events

    def close(self) -> None:
        """End the compute process."""
        if self._client is not None:
            self._client.close()
            self._client = None
        self._volume = None
        self._reset()

    def _ask(self, what: str, arrays: Sequence[np.ndarray] = (), **content: Any) -> None:
        if self._client is None:
            self._client = self._start_client()
        self._pending[self._client.request(what, arrays, **content)] = _Asked(what, [])

    def _ask_about_classes(self, what: str, **content: Any) -> None:
        ids = [fields["id"] for fields in self._classes]
        classes = [{name: value for name, value in fields.items() if name != "id"} for fields in self._classes]
        assert self._client is not None
        self._pending[self._client.request(what, classes=classes, **content)] = _Asked(what, ids)

    def _give_up(self, kinds: Collection[str]) -> None:
        """Let nothing of these kinds that was asked before delay, or be taken for, an answer to what comes."""
        numbers = [number for number, asked in self._pending.items() if asked.what in kinds]
        if self._client is not None and numbers:
            self._client.cancel(numbers)
        for number in numbers:
            del self._pending[number]

    def _send_due(self) -> None:
        """Send the most urgent of what is due; the others wait until it is done, lest they hold up what comes then."""
        running = {asked.what for asked in self._pending.values()}
        if not self.usable:
            return
        if self._maps_due:
            if not running & {"maps", "segment"}:
                self._give_up(("refine", "render"))
                self._send_maps()
        elif running:
            return
        elif self._rendering_wanted and time.monotonic() >= (self._rendering_due_s or 0.0):
            self._send_rendering()
        elif self._refine_due_s is not None and time.monotonic() >= self._refine_due_s:
            self._refine_due_s = None
            self._ask_about_classes("refine", **self._refinement)

    def _send_maps(self) -> None:
        self._maps_due = False
        if not self._classes:
            self.maps, self.rendering = {}, None
            return
        self._ask_about_classes("maps")
        if self._refinement:
            self._refine_due_s = time.monotonic() + REFINE_AFTER_S

    @property
    def _rendering_wanted(self) -> bool:
        return self._rendering_due_s is not None and self._look is not None and bool(self.maps)

    def _send_rendering(self) -> None:
        """Ask for the maps that are shown now as a volume of colours."""
        assert self._look is not None
        self._rendering_due_s = None
        styles = [self._look["styles"].get(id_, ((0.0, 0.0, 0.0), 0.0)) for id_ in self.maps]
        self._ask("render", rendering=self._look["rendering"], refined=self.refined, styles=styles)

    def _receive(self, reply: Message) -> set[Event]:
        content = reply.content
        if content["request"] not in self._pending:
            return set()  # It was given up since.
        if content["reply"] == "coarse":
            self.usable = self._maps_due = True
            return {"state"}
        if content["reply"] == "progress":
            return self._show_progress(content)
        asked = self._pending.pop(content["request"])
        if asked.what in _WAITED_FOR:
            self.progress = None
        if content["reply"] == "done":
            return getattr(self, f"_done_{asked.what}")(reply, asked.ids)
        if asked.what == "extract":
            self.phase = "no features"
        elif asked.what == "volume":
            # What was asked about it next cannot be answered either.
            self.phase = "no volume"
            self._pending.clear()
        if content["reply"] == "failed":
            self._error = content["message"]
        return {"state"}

    def _show_progress(self, content: dict[str, Any]) -> set[Event]:
        if self._pending[content["request"]].what not in _WAITED_FOR:
            return set()
        done, total, what = content["done"], content["total"], content["what"]
        if self.progress is None or self.progress.what != what:
            self._started_s = time.monotonic()
        elapsed = time.monotonic() - self._started_s
        left = elapsed * (total - done) / done if done and elapsed > 1.0 else None
        self.progress = Progressing(done, total, what, left)
        return {"state"}

    def _done_volume(self, reply: Message, ids: list[str]) -> set[Event]:
        return set()

    def _done_prepare(self, reply: Message, ids: list[str]) -> set[Event]:
        content = {name: reply.content[name] for name in ("cached", "seconds", "memory_bytes", "download_mb")}
        self.estimate = Estimate(**content)
        if self.estimate.cached and self.phase == "no features":
            self.extract()
        return {"state"}

    def _done_extract(self, reply: Message, ids: list[str]) -> set[Event]:
        self.phase = "ready"
        self.usable = self._maps_due = True
        return {"state"}

    def _done_maps(self, reply: Message, ids: list[str]) -> set[Event]:
        ijk_to_ras = np.array(reply.content["ijk_to_ras"])
        answers = zip(ids, reply.arrays[0], reply.content["isos"], strict=True)
        self.maps = {id_: ShownMap(similarity, ijk_to_ras, iso) for id_, similarity, iso in answers}
        self.refined, self._rendering_due_s = False, time.monotonic() + RENDER_AFTER_S
        return {"maps"}

    def _done_refine(self, reply: Message, ids: list[str]) -> set[Event]:
        answers = zip(ids, reply.arrays, reply.content["maps"], strict=True)
        self.maps = {id_: ShownMap(array, np.array(told["ijk_to_ras"]), told["iso"]) for id_, array, told in answers}
        self.refined, self._rendering_due_s = True, time.monotonic()
        return {"refined"}

    def _done_render(self, reply: Message, ids: list[str]) -> set[Event]:
        self.rendering = reply.arrays[0], np.array(reply.content["ijk_to_ras"])
        return {"rendering"}

    def _done_segment(self, reply: Message, ids: list[str]) -> set[Event]:
        self.labels = reply.arrays[0], ids
        return {"labels"}

    def _lost(self) -> None:
        """The process died: out of memory, say. Whatever it held can be computed anew."""
        assert self._client is not None
        last = self._client.last_words().rpartition("\n")[2]
        self._client.close()
        self._client = None
        self._reset()
        self._error = (
            "The process that computes ended unexpectedly"
            f"{f' ({last})' if last else ', perhaps because the computer ran out of memory'}. Your annotations are untouched; "
            "compute the features again, with a coarser grid or another device if it happens again."
        )
