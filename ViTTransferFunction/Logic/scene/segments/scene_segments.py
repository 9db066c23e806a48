"""From the user's word to segments: whether there is something to write, what is asked for, and what the user is told."""

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
    """Knows which segments there are; has the classes segmented in the compute process, and written as segments.

    Args:
        scene: that gets the segments.
        app_logic: the application's logic.
        parameters: say which volume and segmentation.
        proxy: asks the compute process.
        problems: get what the user has to know.
        notices: front ends hear of that.
        volume: as it was opened.
        classes: all, as they are now.
        requests: what is asked for of them.
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
        """Of all segments of the chosen segmentation, those that others made among them, by their IDs and in their order."""
        node = self._parameters.segmentation
        segmentation = node.GetSegmentation() if node else slicer.vtkSegmentation()
        return {id_: segmentation.GetSegment(id_).GetName() for id_ in segmentation.GetSegmentIDs()}

    @property
    def busy(self) -> bool:
        """Whether labels are being turned into segments."""
        return self._output.busy

    @property
    def progress(self) -> WorkProgress | None:
        """Of that."""
        return self._output.progress

    @property
    def can_write(self) -> bool:
        """Whether there is something to write, or nothing but segments to remove whose classes are gone."""
        if self._is_annotated:
            return self._proxy.phase == "ready"
        return self._proxy.phase != "no volume" and bool(self.left)

    def write(self, corrections: Corrections | Literal["ask"] = "keep") -> None:
        """Have all classes segmented and written as segments; into a new segmentation where none is chosen.

        Segments of classes that are gone are removed, unless they were corrected by hand.

        Args:
            corrections: what becomes of segments whose voxels were changed since they were written. "keep": they stay, and new
                segments are written beside them. "overwrite": they get the new voxels. "ask": as "keep" where there are none;
                otherwise nothing is written, `take_corrected` names them, and this is to be called again with an answer.
        """
        self._begin(corrections)
        self._notices.tell()

    def advance(self) -> None:
        """Take labels in that have arrived, or go on to turn them into segments."""
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
        """Stop turning labels into segments; nothing has changed."""
        self._output.cancel()

    def take_written(self) -> bool:
        """Whether segments were written since the last call."""
        return self._output.take_written()

    def take_corrected(self) -> tuple[str, ...]:
        """Names of the segments about which the front end has to ask the user since the last call; most often none."""
        return self._output.take_corrected()

    @property
    def _is_annotated(self) -> bool:
        """Whether there is a class that a segment can be made of."""
        return any(state.positive for state in self._classes())

    def _begin(self, corrections: Corrections | Literal["ask"]) -> None:
        """Ask for labels, look for corrections, or tell why there is nothing to do."""
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
            # Another one that is chosen meanwhile is not what was asked about, nor what the answer about corrections is for.
            self._into = self._parameters.segmentation
            self._proxy.segment(self._parameters.refinement())

    def _obstacle(self) -> str:
        """Why segments cannot be written where they are to go, as far as that is known before there are any; or ""."""
        node = self._parameters.segmentation
        try:
            if node is not None:
                check_writable(node, self._parameters.volume)
        except InputError as error:
            return str(error)
        return ""

    def _remove_left(self) -> None:
        """Write that there are no structures any more, for which nothing has to be computed."""
        nothing = Labels(np.zeros((0, 0, 0), dtype=np.uint8), (0, 0, 0))
        try:
            self._output.write(self._parameters.segmentation, nothing, (), "keep", self.source_now)
        except InputError as error:
            self._report(str(error))

    def _report(self, message: str) -> None:
        self._problems.put("segments", message)
