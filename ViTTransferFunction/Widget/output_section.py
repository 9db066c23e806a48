"""The structures as segments of a segmentation that the user chooses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.scene.segments import CLASS_TAG
from ViTTransferFunction.Widget.progress_row import ProgressRow
from ViTTransferFunction.Widget.section import Section, signals_blocked


class OutputSection(Section):
    """Selector of the segmentation, the button that writes, and its progress."""

    def __init__(self, ui: Any, report: Callable[[str], None]) -> None:
        super().__init__(ui, report)
        self._progress = ProgressRow(ui, "segmentation")
        ui.segmentationSelector.setMRMLScene(slicer.mrmlScene)
        ui.segmentationSelector.currentNodeChanged.connect(self._on_segmentation_selected)
        ui.writeSegmentsButton.clicked.connect(self._on_write)
        self._progress.cancel_button.clicked.connect(self._on_cancel)

    def refresh(self) -> None:
        """Show where segments go to, and whether they can be written now."""
        session = self.session
        node = session.parameters.segmentation if session else None
        self.ui.segmentationSelector.enabled = session is not None
        with signals_blocked(self.ui.segmentationSelector):
            self.ui.segmentationSelector.setCurrentNode(node)
        ready = session is not None and session.phase == "ready"
        running = session.progress if session and ready else None
        annotated = session is not None and any(state.positive for state in session.classes)
        self._progress.show(running)
        self.ui.writeSegmentsButton.visible = running is None
        self.ui.writeSegmentsButton.enabled = ready and annotated
        self.ui.writeSegmentsButton.text = _("Update segments") if _has_our_segments(node) else _("Create segments")
        self.ui.writeSegmentsButton.toolTip = (
            _("Write every structure as a segment, at full resolution.")
            if ready and annotated
            else _("Compute the features, and place a point on a structure first.")
        )

    def _on_segmentation_selected(self) -> None:
        if self.session is not None:
            self.session.set_segmentation(self.ui.segmentationSelector.currentNode())

    def _on_write(self) -> None:
        if self.session is not None:
            self.session.write_segments()

    def _on_cancel(self) -> None:
        if self.session is not None:
            self.session.cancel()


def _has_our_segments(node: slicer.vtkMRMLSegmentationNode | None) -> bool:
    if node is None:
        return False
    segmentation = node.GetSegmentation()
    segments = (segmentation.GetNthSegment(n) for n in range(segmentation.GetNumberOfSegments()))
    return any(segment.HasTag(CLASS_TAG) for segment in segments)
