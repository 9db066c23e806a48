"""From scan to scan: each has classes, a segmentation and a selected class of its own."""

from __future__ import annotations

import slicer

from .annotation.annotations import SceneAnnotations
from .annotation.continued_segments import ContinuedSegments
from .annotation.selected_class import SelectedClass
from .interface.notices import Notices
from .interface.parameters import SceneParameters
from .interface.problems import Problems
from .segments.written_segments import choose_segmentation_of


class ScanChange:
    """Goes from one volume of the scene to another.

    Args:
        parameters: say which volume and segmentation are chosen.
        annotations: hold the classes of all volumes.
        continued_segments: those that were chosen lie in the volume before.
        problems: what they told of the structures of one volume does not concern the next.
        selected: which class.
        notices: front ends hear of another volume when all of it is there.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        continued_segments: ContinuedSegments,
        problems: Problems,
        selected: SelectedClass,
        notices: Notices,
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._continued_segments = continued_segments
        self._problems = problems
        self._selected = selected
        self._notices = notices
        self._selected_last: dict[str, str] = {}  # By the ID of a volume: the class that was annotated there last.

    def go_to(self, node: slicer.vtkMRMLScalarVolumeNode | None) -> None:
        """Choose a volume, or none; what it has is there again. One that has no classes yet gets those of the one before.

        They come without their points: in a follow-up, in another phase, or in the next patient of a series, the same
        structures are looked for. One step of undo takes them away.
        """
        left = self._parameters.volume
        if node is left:
            return
        before, selected = self._annotations.classes, self._selected.state
        if left is not None and selected is not None:
            self._selected_last[left.GetID()] = selected.id
        when_left = self._annotations.leave()
        self._continued_segments.forget()
        with self._notices.one():
            self._problems.solve("segments", "close-up")
            if node is not None:
                choose_segmentation_of(node, self._parameters)
            self._parameters.set_reference("volume", node)
            if node is not None and before and self._annotations.untouched:
                self._annotations.bring_along(before)
                ids = {state.name: state.id for state in reversed(self._annotations.classes)}
                self._selected.select(ids[(selected or before[0]).name])
            elif node is not None and node.GetID() in self._selected_last:
                self._selected.select(self._selected_last[node.GetID()])
        when_left()  # By now the tool in hand works on another list.
