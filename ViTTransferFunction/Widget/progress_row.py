"""A progress bar with the time that is left, and a button to cancel."""

from __future__ import annotations

from typing import Any

from ViTTransferFunction.Logic.core.system.progress import WorkProgress
from ViTTransferFunction.Logic.scene.interface.number_texts import progress_text

MOST_STEPS = 1_000_000
"""Of a bar. Qt counts with 32 bits, and a large scan has more voxels than these can say."""


class ProgressRow:
    """The widgets of one progress bar.

    Args:
        ui: the widgets of the panel, by name.
        name: what the names of the bar's widgets begin with.
    """

    def __init__(self, ui: Any, name: str) -> None:
        self._row = getattr(ui, f"{name}ProgressRow")
        self._label = getattr(ui, f"{name}ProgressLabel")
        self._bar = getattr(ui, f"{name}ProgressBar")
        self.cancel_button = getattr(ui, f"{name}CancelButton")

    def show(self, progress: WorkProgress | None) -> None:
        """Show how far the work is; hide the row where None is running."""
        self._row.visible = progress is not None
        if progress is not None:
            self._label.text = progress_text(progress)
            # A bar without a maximum moves to and fro: something is being done, and nobody knows how long it takes.
            scale = max(progress.total // MOST_STEPS, 1)
            self._bar.maximum = progress.total // scale
            self._bar.value = progress.done // scale
