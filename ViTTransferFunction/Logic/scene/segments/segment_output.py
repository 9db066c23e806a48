"""Turns labels into segments of the scene, a little at a time, so that the event loop is never blocked."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, Protocol

import slicer

from ...compute.requests import Labels
from ...core.system.errors import InputError
from ...core.system.progress import WorkProgress
from ...core.volumes.stepped_work import SteppedWork, Steps
from ..classes.class_state import Classes
from ..interface.message_texts import empty_text, mostly_taken_text, segmentation_removed_text, taken_text
from ..interface.parameters import REFERENCES, SceneParameters
from ..mrml.nodes import name_for_scene
from ..volumes.volume_content import frame_of
from .corrections import Corrections, corrected_segments
from .segment_preparation import ClassLabels, PreparedSegments, prepare_segments, segmentation_state
from .segment_tags import segments_of_classes
from .segment_writing import ClassLook, check_writable, write_prepared
from .terminology import StandardCodes
from .written_segments import written_classes

WRITING = "Writing segments"
"""What `progress` names while segments are prepared from labels."""


class SegmentOutput:
    """Finds out which segments were corrected by hand, and writes segments; both a little at each call of `advance`.

    The work ends early if one of its nodes leaves the scene: with an error if it was the segmentation, silently if it was the
    volume, since all that is shown goes with that.

    Args:
        scene: the scene.
        app_logic: the application's logic.
        parameters: give the volume, the segmentation, and whether other segments are respected.
        classes: returns the present classes.
        report: called with a message for the user if some of the written segments are empty, or lack most of their voxels.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        parameters: SceneParameters,
        classes: Callable[[], Classes],
        report: Callable[[str], None],
    ) -> None:
        self._scene = scene
        self._codes = StandardCodes(app_logic)
        self._parameters = parameters
        self._classes = classes
        self._report = report
        # The running work, and what to do when it is finished: one attribute, so that both free their voxels at once.
        self._running: tuple[_Work, Callable[[], None]] | None = None
        self._corrected: tuple[str, ...] = ()
        self._written = False

    @property
    def busy(self) -> bool:
        """Whether `advance` has something to do."""
        return self._running is not None

    @property
    def progress(self) -> WorkProgress | None:
        """Progress of the running work; None if there is none."""
        return self._running[0].progress if self._running else None

    def find_corrections(self, if_none: Callable[[], None]) -> None:
        """Begin to look for corrected segments: afterwards, `take_corrected` has their names, or `if_none` is called."""
        self.cancel()
        node = self._parameters.segmentation
        if node is None:
            if_none()
        else:
            search = _CorrectionSearch(node, self._annotated())
            self._running = search, lambda: self._on_searched(search, if_none)

    def take_corrected(self) -> tuple[str, ...]:
        """Names of the corrected segments that were found since the last call."""
        names, self._corrected = self._corrected, ()
        return names

    def take_written(self) -> bool:
        """Whether segments were written since the last call."""
        written, self._written = self._written, False
        return written

    def write(
        self,
        node: slicer.vtkMRMLSegmentationNode | None,
        labels: Labels,
        class_ids: Sequence[str],
        corrections: Corrections,
        source: str,
    ) -> None:
        """Begin to turn labels into segments of those of the classes that still exist.

        Segments of classes that are gone, or have no positive point any more, are removed unless they were corrected.

        Args:
            node: the segmentation to write to; None: a new one, which becomes the chosen one.
            labels: the volume's labels.
            class_ids: the ids of the classes with the labels 1, 2, ….
            corrections: what to do with segments that were corrected by hand.
            source: identifies what the labels were made from (`WrittenSegments.source_now`).

        Raises:
            InputError: the segments cannot be written to this segmentation.
        """
        self.cancel()
        there = {state.id for state in self._classes()}
        present = tuple(id_ if id_ in there else None for id_ in class_ids)
        volume = self._parameters.volume
        gone = (written_classes(node, volume) if node else set()) - self._annotated() - set(present)
        if volume is None or not (any(present) or gone):
            return
        if node is not None and not self._scene.IsNodePresent(node):
            raise InputError(segmentation_removed_text(node.GetName()))
        wanted = ClassLabels(labels.array, labels.first, present)
        continued = {state.id: state.continues for state in self._classes() if state.continues}
        respect_others = self._parameters.get("respectOtherSegments")
        preparation = _Preparation(
            node,
            volume,
            2 * wanted.array.size,  # Each voxel is copied, and then digested.
            lambda: prepare_segments(node, volume, wanted, respect_others, corrections, continued, gone),
        )

        def on_prepared() -> None:
            looks = {state.id: ClassLook(state.name, state.color) for state in self._classes()}
            if wanted.label_of_class.keys() <= looks.keys() and not gone & self._annotated():
                written = preparation.write(lambda: self._new_segmentation(volume), looks, self._codes, source)
                self._written = True
                if about_missing := " ".join(_about_missing_voxels(written, looks)):
                    self._report(about_missing)
            else:  # A class was removed meanwhile, or came back.
                self.write(node, labels, class_ids, corrections, source)

        self._running = preparation, on_prepared

    def advance(self) -> None:
        """Work for some milliseconds. Raises InputError if segments can no longer be written. Any error ends the work."""
        if self._running is None:
            return
        work, then = self._running
        removed = [node for node in work.nodes if not self._scene.IsNodePresent(node)]
        if removed:
            self._running = None
            if self._parameters.volume is not None and removed[0].IsA(REFERENCES["segmentation"]):
                raise InputError(segmentation_removed_text(removed[0].GetName()))
            return
        unknown = next((state.name for state in self._classes() if not self._codes.looked_for(state.name)), None)
        if unknown is not None:
            self._codes.entry(unknown)
            return
        try:
            finished = work.advance()
        except BaseException:
            self._running = None  # So that the next call does not raise the same again.
            raise
        if finished:
            self._running = None
            then()

    def cancel(self) -> None:
        """Stop the running work; the scene has not changed."""
        self._running, self._corrected = None, ()

    def _annotated(self) -> set[str]:
        """Ids of the classes with a positive point, of which segments can be made."""
        return {state.id for state in self._classes() if state.positive}

    def _on_searched(self, search: _CorrectionSearch, if_none: Callable[[], None]) -> None:
        self._corrected = search.names
        if not search.names:
            if_none()

    def _new_segmentation(self, volume: slicer.vtkMRMLScalarVolumeNode) -> slicer.vtkMRMLSegmentationNode:
        frame = frame_of(volume)
        of = f"{volume.GetName()} frame {frame.number}" if frame else volume.GetName()
        node = self._scene.AddNewNodeByClass("vtkMRMLSegmentationNode", name_for_scene(f"{of} segmentation"))
        self._parameters.set_reference("segmentation", node)
        return node


def _about_missing_voxels(written: PreparedSegments, looks: Mapping[str, ClassLook]) -> Iterator[str]:
    """Messages for the user about classes whose segments are empty, or lack most voxels since other segments have them."""
    empty, taken = set(written.empty), set(written.mostly_taken)
    for ids, text in ((empty - taken, empty_text), (empty & taken, taken_text), (taken - empty, mostly_taken_text)):
        if ids:
            yield text([looks[id_].name for id_ in written.labels if id_ in ids])


class _Work(Protocol):
    """Work that is done a little at a time, and that needs some nodes of the scene."""

    nodes: tuple[Any, ...]

    def advance(self) -> bool:
        """Do some of the work; returns whether it is finished."""

    @property
    def progress(self) -> WorkProgress:
        """How far it is."""


class _CorrectionSearch:
    """Looks for segments that were corrected by hand; `names` has theirs once it is finished."""

    def __init__(self, segmentation_node: Any, class_ids: Collection[str]) -> None:
        self.nodes = (segmentation_node,)
        self.names: tuple[str, ...] = ()
        self._segmentation = segmentation_node.GetSegmentation()
        self._search = SteppedWork(corrected_segments(self._segmentation, segments_of_classes(self._segmentation, class_ids)))

    def advance(self) -> bool:
        """Look on; returns whether it is finished."""
        if not self._search.advance():
            return False
        found = set((self._search.result or {}).values())
        self.names = tuple(
            self._segmentation.GetSegment(segment_id).GetName()
            for segment_id in self._segmentation.GetSegmentIDs()
            if segment_id in found
        )
        return True

    @property
    def progress(self) -> WorkProgress:
        """Without a total, which is not known."""
        return WorkProgress(0, 0, "Looking for corrections by hand", None)


class _Preparation:
    """Prepares segments, and starts again if the segmentation changes meanwhile. The scene does not change before `write`."""

    def __init__(
        self, segmentation_node: Any, volume_node: Any, total: int, prepare: Callable[[], Steps[PreparedSegments]]
    ) -> None:
        self.nodes = (volume_node, *((segmentation_node,) if segmentation_node else ()))
        self._segmentation_node, self._volume_node = segmentation_node, volume_node
        self._total, self._prepare = max(total, 1), prepare
        if segmentation_node is not None:
            check_writable(segmentation_node, volume_node)
        self._begin()

    def advance(self) -> bool:
        """Prepare some more, or start again if the segmentation was changed meanwhile; returns whether all is ready."""
        if not self._preparation.advance():
            return False
        if self._segmentation_node is not None:
            check_writable(self._segmentation_node, self._volume_node)
        if segmentation_state(self._segmentation_node, self._volume_node) != self._state:
            self._begin()
            return False
        return True

    def write(
        self, new_segmentation: Callable[[], Any], looks: Mapping[str, ClassLook], codes: StandardCodes, source: str
    ) -> PreparedSegments:
        """Write the prepared segments in one step, and return them."""
        prepared: PreparedSegments | None = self._preparation.result
        assert prepared is not None
        write_prepared(prepared, self._segmentation_node or new_segmentation(), self._volume_node, looks, codes, source)
        return prepared

    @property
    def progress(self) -> WorkProgress:
        """How far it is."""
        return WorkProgress(min(self._preparation.done, self._total), self._total, WRITING, None)

    def _begin(self) -> None:
        self._state = segmentation_state(self._segmentation_node, self._volume_node)
        self._preparation = SteppedWork(self._prepare())
