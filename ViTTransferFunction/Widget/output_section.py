"""The structures as segments of a segmentation that the user chooses, and what else can be done with its segments."""

from __future__ import annotations

from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.scene.interface.message_texts import outdated_text
from ViTTransferFunction.Logic.scene.mrml.nodes import in_text
from ViTTransferFunction.Logic.scene.segments.corrections import Corrections
from ViTTransferFunction.Widget.node_selector import fill_selector
from ViTTransferFunction.Widget.progress_row import ProgressRow
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked
from ViTTransferFunction.Widget.wording import in_menu


class OutputSection(Section):
    """Selector of the segmentation, the button that writes, its progress, and ways to go on with the segments."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._progress = ProgressRow(ui, "segmentation")
        self._segments_menu = qt.QMenu(ui.continueSegmentButton)
        ui.continueSegmentButton.setMenu(self._segments_menu)
        self._about_continuing = ui.continueSegmentButton.toolTip
        fill_selector(ui.segmentationSelector)
        ui.segmentationSelector.currentNodeChanged.connect(self._on_segmentation_selected)
        ui.writeSegmentsButton.clicked.connect(self._on_write)
        ui.editSegmentsButton.clicked.connect(self._on_edit)
        self._segments_menu.aboutToShow.connect(self._list_segments)
        self._progress.cancel_button.clicked.connect(self.cancel)

    def refresh(self) -> None:
        """Show where segments go to, and what can be done now; ask where corrections are in the way."""
        session = self.session
        node = session.parameters.segmentation if session else None
        self.ui.segmentationSelector.enabled = session is not None
        with signals_blocked(self.ui.segmentationSelector):
            self.ui.segmentationSelector.setCurrentNode(node)
        self._refresh_writing()
        self.ui.show3DButton.setSegmentationNode(node)
        self.ui.editSegmentsButton.enabled = node is not None
        continuable = session is not None and bool(session.segments.names)
        self.ui.continueSegmentButton.enabled = continuable
        self.ui.continueSegmentButton.toolTip = (
            self._about_continuing
            if continuable
            else _('First choose the segmentation that has the segment, under "Write to".')
        )
        corrected = session.segments.take_corrected() if session else ()
        if corrected:
            # Not in the midst of a refresh: the panel goes on behind the question.
            qt.QTimer.singleShot(0, lambda: self._ask(corrected))

    def _refresh_writing(self) -> None:
        session = self.session
        ready = session is not None and session.phase == "ready"
        running = session.progress if session and ready and not session.looks_closer else None
        writable = session is not None and session.segments.can_write
        ours = session is not None and session.segments.exist
        outdated = session is not None and session.segments.outdated
        self.ui.writeSegmentsButton.enabled = writable
        if running is None:
            self.ui.writeSegmentsButton.visible = True
            if self._progress.cancel_button.focus:
                # It had the keyboard when it made room for this one; what Qt would choose is far below.
                self.ui.writeSegmentsButton.setFocus()
        self._progress.show(running)
        self.ui.writeSegmentsButton.visible = running is None
        self.ui.writeSegmentsButton.text = _("Update segments") if ours else _("Create segments")
        self.ui.segmentsOutdatedLabel.visible = outdated
        self.ui.segmentsOutdatedLabel.text = outdated_text() if outdated else ""
        self.ui.writeSegmentsButton.toolTip = (
            _("Write every structure as a segment, at full resolution.")
            if writable
            else _("Compute the features, and place a point on a structure first.")
        )

    def _on_segmentation_selected(self) -> None:
        if self.session is not None:
            self.session.set_segmentation(self.ui.segmentationSelector.currentNode())

    def _on_write(self) -> None:
        if self.session is not None:
            self.session.segments.write("ask")

    def _ask(self, corrected: tuple[str, ...]) -> None:
        """Have the user decide about corrected segments, and go on as decided."""
        session = self.session
        if session is None:
            return
        answer = ask_about_corrections(corrected)
        if answer is not None and session is self.session:
            session.segments.write(answer)

    def _on_edit(self) -> None:
        """Go to the Segment Editor, with the selected structure's segment in hand where there is one."""
        session, selected = self.session, self.selected
        node = session.parameters.segmentation if session else None
        if session is None or node is None:
            return
        volume = session.parameters.volume
        slicer.util.selectModule("SegmentEditor")
        editor = slicer.modules.segmenteditor.widgetRepresentation().self().editor
        # In this order: the editor takes a source volume only for a segmentation that it has.
        editor.setSegmentationNode(node)
        if volume is not None:
            editor.setSourceVolumeNode(volume)
        segment_id = session.segments.of(selected.id) if selected else None
        if segment_id is not None:
            editor.setCurrentSegmentID(segment_id)

    def _list_segments(self) -> None:
        self._segments_menu.clear()
        for segment_id, name in (self.session.segments.names if self.session else {}).items():
            self._offer(segment_id, name)

    def _offer(self, segment_id: str, name: str) -> None:
        action = self._segments_menu.addAction(in_menu(name))
        action.triggered.connect(lambda: self._on_continue(segment_id))

    def _on_continue(self, segment_id: str) -> None:
        if self.session is not None:
            self.session.continue_segment(segment_id)


def ask_about_corrections(names: tuple[str, ...]) -> Corrections | None:
    """Ask what is to become of segments that were changed by hand since they were written; None: nothing is to be written.

    Corrections are kept, without a question, where the application is tested, as with Slicer's own questions.
    """
    if slicer.app.testingEnabled():
        return "keep"
    box = qt.QMessageBox(slicer.util.mainWindow())
    box.icon = qt.QMessageBox.Question
    box.windowTitle = _("Update segments")
    box.textFormat = qt.Qt.PlainText  # Names may look like tags.
    box.text = _("Changed since the last update: {names}.").format(names=", ".join(map(in_text, names)))
    box.informativeText = _(
        "Keep corrections: they stay, and new results are written beside them as new segments. Overwrite corrections: they are "
        "lost. All other structures are updated either way."
    )
    keep = box.addButton(_("Keep corrections"), qt.QMessageBox.AcceptRole)
    overwrite = box.addButton(_("Overwrite corrections"), qt.QMessageBox.DestructiveRole)
    box.addButton(_("Cancel"), qt.QMessageBox.RejectRole)
    box.setDefaultButton(keep)
    box.exec_()
    clicked = box.clickedButton()
    box.deleteLater()
    return "keep" if clicked == keep else "overwrite" if clicked == overwrite else None
