"""The volume to segment, and its features: what they will cost, how far they are, and which of the points count."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.progress import WorkProgress
from ViTTransferFunction.Logic.scene.feature_wording import cost_text, missing_text, point_warnings, status_text
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views.volume_in_slices import fit_in_slices, show_in_slices
from ViTTransferFunction.Widget.download_consent import DownloadConsent
from ViTTransferFunction.Widget.node_selector import fill_selector
from ViTTransferFunction.Widget.offered_volume import OfferedVolume
from ViTTransferFunction.Widget.progress_row import ProgressRow
from ViTTransferFunction.Widget.pytorch_installation import pytorch_is_installed
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked
from ViTTransferFunction.Widget.wording import breakable


class VolumeSection(Section):
    """Selector, button, progress and status of the features, of which one shows at a time.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.
        on_leave: called before another volume is chosen.

    Attributes:
        offered: has a volume taken up where none is chosen.
    """

    def __init__(self, ui: Any, report: Report, on_leave: Callable[[], None]) -> None:
        super().__init__(ui, report)
        self._on_leave = on_leave
        self._progress = ProgressRow(ui, "extraction")
        self.offered = OfferedVolume(slicer.app.applicationLogic(), report)
        self._consent = DownloadConsent()
        # Whose features are to be computed, as soon as it is known what they cost.
        self._pressed_for: slicer.vtkMRMLScalarVolumeNode | None = None
        self._told_name = ""
        fill_selector(ui.volumeSelector)
        ui.volumeSelector.currentNodeChanged.connect(self._on_volume_selected)
        ui.extractButton.clicked.connect(self._on_extract)
        self._progress.cancel_button.clicked.connect(self._on_cancel)

    def refresh(self) -> None:
        """Show the volume and how far its features are."""
        session = self.session
        self.offered.offer_to(session)
        phase = session.phase if session else "no volume"
        self.ui.volumeSelector.enabled = session is not None
        with signals_blocked(self.ui.volumeSelector):
            self.ui.volumeSelector.setCurrentNode(session.parameters.volume if session else None)
        # What was pressed ends with the session: where that was the application's end, the widgets go before the timer is due.
        if session is None or session.parameters.volume is not self._pressed_for:
            self._pressed_for = None
        if self._pressed_for is not None:
            qt.QTimer.singleShot(0, self._go_on)
        self._show_features(session, "extracting" if self._pressed_for is not None else phase)
        self._show_point_warnings(session)
        self._tell_of_name(session)

    def _show_features(self, session: SceneSession | None, phase: str) -> None:
        ui, status = self.ui, status_text(session, phase)
        if session is not None and phase == "no features":
            status = missing_text(session)
        ui.extractionStatusLabel.visible = bool(status)
        ui.extractionStatusLabel.text = status
        obstacle = _obstacle(session, phase)
        ui.extractButton.enabled = not obstacle
        ui.extractButton.toolTip = obstacle or _(
            "Compute the features, which tell the structures apart: once for each volume, then kept in the cache. "
            "You can go on working meanwhile."
        )
        ui.estimateLabel.text = obstacle or (cost_text(session) if session else "")
        self._show_rows(phase, _extraction_progress(session.progress) if session and phase == "extracting" else None)

    def _show_rows(self, phase: str, progress: WorkProgress | None) -> None:
        """Show what begins the extraction, or what cancels it: before the other goes, which may have the keyboard."""
        starts = phase in ("no volume", "no features")
        if starts:
            self.ui.extractionStartRow.visible = True
        if progress is not None:
            self._progress.show(progress)
        if self.ui.extractButton.focus or self._progress.cancel_button.focus:
            self._keep_keyboard(phase)
        self.ui.extractionStartRow.visible = starts
        self._progress.show(progress)

    def _keep_keyboard(self, phase: str) -> None:
        """What has the keyboard may go. Qt would choose the next section's header, scroll there, and Space would close that."""
        if phase == "extracting":
            self._progress.cancel_button.setFocus()
        elif phase == "ready":
            self.ui.addClassButton.setFocus()
        else:
            self.ui.extractButton.setFocus()

    def _show_point_warnings(self, session: SceneSession | None) -> None:
        lines = point_warnings(session) if session else []
        self.ui.pointWarningsLabel.visible = bool(lines)
        self.ui.pointWarningsLabel.text = breakable("\n".join(lines))

    def _tell_of_name(self, session: SceneSession | None) -> None:
        """Slicer writes an & in a volume's name into scenes as no XML; the name is the user's to change."""
        name = _volume_name(session)
        told, self._told_name = self._told_name, name
        if name != told and "&" in name:
            text = _(
                "Slicer may be unable to open a scene again that was saved with an & in a name, such as {name}. Rename the "
                "scan before you save, by a double click on it in the module Data."
            )
            self.report(text.format(name=name), solved=lambda: _volume_name(self.session) != name)

    def _on_volume_selected(self) -> None:
        node = self.ui.volumeSelector.currentNode()
        if self.session is not None:
            before = self.session.parameters.volume
            self._on_leave()
            self.session.set_volume(node)
            if node is not None:
                show_in_slices(slicer.mrmlScene, slicer.app.applicationLogic(), node)
            if node is not None and before is not None and before is not node:
                fit_in_slices(slicer.mrmlScene, slicer.app.applicationLogic(), node)

    def _on_extract(self) -> None:
        if self.session is not None:
            self._pressed_for = self.session.parameters.volume
            if self.session.estimate is None and not self.session.busy:
                self.session.estimate_again()
            self.refresh()

    def _go_on(self) -> None:
        """Compute, once it is known whether something has to be downloaded for it, and the user agrees."""
        session = self.session
        if session is None or self._pressed_for is None:
            return
        estimate = session.estimate if session.phase == "no features" else None
        if (estimate is None and not session.busy) or session.phase in ("no volume", "extracting", "ready"):
            self._pressed_for = None
            self.refresh()
        elif estimate is not None:
            self._pressed_for = None
            # Behind the question, nothing looks as if it had begun.
            self.refresh()
            agreed = estimate.download is None or self._consent.is_given(estimate.download)
            # The question leaves the user time for something else.
            if agreed and self.session is session and session.estimate is estimate:
                session.start_extraction()
            self.refresh()

    def _on_cancel(self) -> None:
        self._pressed_for = None
        self.cancel()
        self.refresh()


def _volume_name(session: SceneSession | None) -> str:
    volume = session.parameters.volume if session else None
    return (volume.GetName() or "") if volume else ""


def _extraction_progress(progress: WorkProgress | None) -> WorkProgress:
    return progress or WorkProgress(0, 0, _("Starting"), None)


def _obstacle(session: SceneSession | None, phase: str) -> str:
    """Why features cannot be computed now, or ""."""
    if phase == "no volume":
        refused = session is not None and session.parameters.volume is not None
        return _("This volume cannot be used as it is.") if refused else _("Select a volume first.")
    return "" if pytorch_is_installed() else _("Install PyTorch first.")
