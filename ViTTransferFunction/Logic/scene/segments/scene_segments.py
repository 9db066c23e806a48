"""Writes segments at the user's request: checks that this is possible, requests labels, and reports problems."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
import slicer

from ...compute.proxy import SegmentationProxy
from ...compute.requests import Labels
from ...core.classes.class_request import ClassRequest
from ...core.system.errors import InputError
from ...core.system.progress import WorkProgress
from ..classes.class_state import Classes
from ..interface.notices import Notices
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..volumes.opened_volume import OpenedVolume
from .corrections import Corrections
from .segment_output import SegmentOutput
from .segment_writing import check_writable
from .written_segments import WrittenSegments


class SceneSegments(WrittenSegments):
    """Has the classes segmented in the compute process, writes them as segments, and knows which segments exist.

    Args:
        scene: the scene that gets the segments.
        app_logic: the application's logic.
        parameters: have the volume and the segmentation.
        proxy: sends requests to the compute process.
        problems: receives problems to report to the user.
        notices: notifies front ends of changes.
        volume: the open volume.
        classes: returns all current classes.
        requests: returns the requests for their maps.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        parameters: SceneParameters,
        proxy: SegmentationProxy,
        problems: Problems,
        notices: Notices,
        volume: OpenedVolume,
        classes: Callable[[], Classes],
        requests: Callable[[], Sequence[ClassRequest]],
    ) -> None:
        super().__init__(parameters, classes, requests, lambda: proxy.voxels)
        self._proxy = proxy
        self._problems = problems
        self._notices = notices
        self._volume = volume
        self._output = SegmentOutput(scene, app_logic, parameters, classes, self._report)
        self._corrections: Corrections = "keep"
        self._written_from = ""
        self._into: slicer.vtkMRMLSegmentationNode | None = None

    @property
    def names(self) -> dict[str, str]:
        """Names of all segments in the chosen segmentation by ID, in their order, including those that were not made here."""
        node = self._parameters.segmentation
        segmentation = node.GetSegmentation() if node else slicer.vtkSegmentation()
        return {id_: segmentation.GetSegment(id_).GetName() for id_ in segmentation.GetSegmentIDs()}

    @property
    def busy(self) -> bool:
        """Whether labels are being converted into segments."""
        return self._output.busy

    @property
    def progress(self) -> WorkProgress | None:
        """Progress of this conversion; None if there is none."""
        return self._output.progress

    @property
    def can_write(self) -> bool:
        """Whether there are classes to write, or at least segments to remove because their classes are gone."""
        if self._is_annotated:
            return self._proxy.phase == "ready"
        return self._proxy.phase != "no volume" and bool(self.left)

    def write(self, corrections: Corrections | Literal["ask"] = "keep") -> None:
        """Segment all classes and write them as segments, into a new segmentation if none is chosen.

        Segments whose classes are gone are removed, unless they were corrected by hand. Problems are reported to the user.

        Args:
            corrections: what happens to segments whose voxels were changed since they were written. "keep": they are kept, and
                new segments are written beside them. "overwrite": they get the new voxels. "ask": as "keep" if there are none;
                otherwise nothing is written, `take_corrected` returns their names, and `write` has to be called again with the
                user's answer.
        """
        self._begin(corrections)
        self._notices.tell()

    def advance(self) -> None:
        """Receive labels that have arrived, or continue to convert them into segments."""
        arrived = self._proxy.take_labels()
        if self._volume.changed:
            self._output.cancel()
            self._report(
                "The image has changed meanwhile, so no segments were written. Write them again when its features are ready."
            )
            return
        try:
            if arrived is not None:
                labels, ids = arrived
                self._output.write(self._into, labels, ids, self._corrections, self._written_from)
            else:
                self._output.advance()
        except InputError as error:
            self._report(str(error))

    def cancel(self) -> None:
        """Cancel the conversion of labels into segments; the segmentation stays unchanged."""
        self._output.cancel()

    def take_written(self) -> bool:
        """Whether segments were written since the last call."""
        return self._output.take_written()

    def take_corrected(self) -> tuple[str, ...]:
        """Names of corrected segments about which the front end has to ask the user, since the last call; usually none."""
        return self._output.take_corrected()

    @property
    def _is_annotated(self) -> bool:
        """Whether any class has a positive point."""
        return any(state.positive for state in self._classes())

    def _begin(self, corrections: Corrections | Literal["ask"]) -> None:
        """Request labels, search for corrections, or report why nothing can be written."""
        self._problems.solve("segments", "older segments", "computing")
        if self.can_write and not self._is_annotated:
            self._remove_left()
        elif self._proxy.phase != "ready" or not self._requests():
            self._report("There is nothing to segment yet: compute the features, and place a point on a structure.")
        elif self._volume.changed:
            self._report("The image has just changed. Wait until its features are ready, then create the segments.")
        elif obstacle := self._obstacle():
            self._report(obstacle)
        elif corrections == "ask":
            self._output.find_corrections(if_none=lambda: self._begin("keep"))
        else:
            self._corrections, self._written_from = corrections, self.source_now
            # Fixed now: the user's request and answer do not apply to a segmentation that is chosen meanwhile.
            self._into = self._parameters.segmentation
            self._proxy.segment(self._parameters.refinement())

    def _obstacle(self) -> str:
        """Why segments cannot be written into the chosen segmentation, as far as known in advance; "" if they can."""
        node = self._parameters.segmentation
        try:
            if node is not None:
                check_writable(node, self._parameters.volume)
        except InputError as error:
            return str(error)
        return ""

    def _remove_left(self) -> None:
        """Remove the segments of classes that are gone; nothing has to be computed for this."""
        nothing = Labels(np.zeros((0, 0, 0), dtype=np.uint8), (0, 0, 0))
        try:
            self._output.write(self._parameters.segmentation, nothing, (), "keep", self.source_now)
        except InputError as error:
            self._report(str(error))

    def _report(self, message: str) -> None:
        self._problems.put("segments", message)
