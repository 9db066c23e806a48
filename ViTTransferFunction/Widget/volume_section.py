"""The volume to segment, and its features: what they will cost, how far they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.progress import WorkProgress
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
from ViTTransferFunction.Widget.progress_row import ProgressRow
from ViTTransferFunction.Widget.pytorch_installation import pytorch_is_installed
from ViTTransferFunction.Widget.section import Section, signals_blocked
from ViTTransferFunction.Widget.wording import duration, size


class VolumeSection(Section):
    """Selector, button, progress and status of the features, of which one shows at a time."""

    def __init__(self, ui: Any, report: Callable[[str], None]) -> None:
        super().__init__(ui, report)
        self._progress = ProgressRow(ui, "extraction")
        ui.volumeSelector.setMRMLScene(slicer.mrmlScene)
        ui.volumeSelector.currentNodeChanged.connect(self._on_volume_selected)
        ui.extractButton.clicked.connect(self._on_extract)
        self._progress.cancel_button.clicked.connect(self._on_cancel)

    def refresh(self) -> None:
        """Show the volume and how far its features are."""
        session = self.session
        phase = session.phase if session else "no volume"
        self.ui.volumeSelector.enabled = session is not None
        with signals_blocked(self.ui.volumeSelector):
            self.ui.volumeSelector.setCurrentNode(session.parameters.volume if session else None)
        self.ui.extractionStartRow.visible = phase in ("no volume", "no features")
        self.ui.extractionStatusLabel.visible = phase == "ready"
        self._progress.show(_extraction_progress(session.progress) if session and phase == "extracting" else None)
        obstacle = _obstacle(phase)
        self.ui.extractButton.enabled = not obstacle
        self.ui.extractButton.toolTip = obstacle or _(
            "Compute what the structures are told apart by: once for each volume, then kept in the cache. "
            "You can go on working meanwhile."
        )
        self.ui.estimateLabel.text = obstacle or (estimate_text(session.estimate) if session else "")

    def _on_volume_selected(self) -> None:
        if self.session is not None:
            self.session.set_volume(self.ui.volumeSelector.currentNode())

    def _on_extract(self) -> None:
        if self.session is not None:
            self.session.start_extraction()

    def _on_cancel(self) -> None:
        if self.session is not None:
            self.session.cancel()


def estimate_text(estimate: FeatureEstimate | None) -> str:
    """What the features will cost, in a few words."""
    if estimate is None:
        return _("Estimating…")
    if estimate.cached:
        return _("In the cache: ready at once.")
    parts = [_("{memory} of memory").format(memory=size(estimate.memory_bytes))]
    if estimate.seconds is not None:
        parts.insert(0, _("About {time}").format(time=duration(estimate.seconds)))
    if estimate.download_mb:
        parts.append(_("{download} to download").format(download=size(estimate.download_mb * 1e6)))
    return ", ".join(parts) + "."


def _extraction_progress(progress: WorkProgress | None) -> WorkProgress:
    return progress or WorkProgress(0, 0, _("Starting"), None)


def _obstacle(phase: str) -> str:
    """Why features cannot be computed now, or ""."""
    if phase == "no volume":
        return _("Select a volume first.")
    return "" if pytorch_is_installed() else _("Install PyTorch first.")
