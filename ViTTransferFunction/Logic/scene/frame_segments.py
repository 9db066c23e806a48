"""Segments of the frames of a sequence: those of the frame that is shown are chosen, and seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import slicer

from .class_state import ClassState
from .opened_volume import OpenedVolume
from .parameters import SceneParameters
from .volume_content import Frame
from .written_segments import choose_segmentation_of

HIDDEN_ATTRIBUTE = "ViTTransferFunction.hiddenWithFrame"
"""Of segmentations that were seen until another frame was shown."""


class FrameSegments:
    """Follows a volume from frame to frame.

    Args:
        parameters: say which volume and segmentation.
        volume: as it was opened.
        classes: all, as they are now.
    """

    def __init__(self, parameters: SceneParameters, volume: OpenedVolume, classes: Callable[[], Sequence[ClassState]]) -> None:
        self._parameters = parameters
        self._volume = volume
        self._classes = classes
        self._last: tuple[slicer.vtkMRMLScalarVolumeNode, Frame] | None = None

    def follow(self) -> bool:
        """The volume was handed over anew. Where it is another frame, its segments do not go over those of the one before.

        These are not seen either, until their frame is shown again: they are of another picture.

        Returns:
            Whether it is a frame that has segments already.
        """
        volume, content, last = self._parameters.volume, self._volume.content, self._last
        if volume is None or content is None or content.frame is None:
            return False
        self._last = volume, content.frame
        if last is None or last[0] is not volume or last[1].number == content.frame.number:
            return False
        before = self._parameters.segmentation
        returned = choose_segmentation_of(volume, self._parameters, [state.id for state in self._classes()])
        now = self._parameters.segmentation
        if before is not None and before is not now:
            _hide(before)
        if now is not None and now is not before:
            _show_again(now)
        return returned


def _hide(segmentation_node: slicer.vtkMRMLSegmentationNode) -> None:
    display = segmentation_node.GetDisplayNode()
    if display is not None and display.GetVisibility():
        display.SetVisibility(False)
        segmentation_node.SetAttribute(HIDDEN_ATTRIBUTE, "1")


def _show_again(segmentation_node: slicer.vtkMRMLSegmentationNode) -> None:
    if segmentation_node.GetAttribute(HIDDEN_ATTRIBUTE) is not None:
        segmentation_node.SetAttribute(HIDDEN_ATTRIBUTE, None)
        segmentation_node.CreateDefaultDisplayNodes()
        segmentation_node.GetDisplayNode().SetVisibility(True)
