"""Where the selected structure is looked at: in the whole volume, or by itself in a box around it; and how far that is."""

from __future__ import annotations

from typing import Any

import qt

from ViTTransferFunction.Logic.scene.interface.message_texts import closer_look_text
from ViTTransferFunction.Widget.progress_row import ProgressRow
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.sight import bring_into_sight, scroll_area_of


class CloseUpControls(Section):
    """A closer look, and the way back."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._progress = ProgressRow(ui, "closeUp")
        self._suggested = self._tells = False
        ui.lookCloserButton.clicked.connect(self.look_closer)
        ui.lookAtWholeButton.clicked.connect(self.look_at_whole)
        self._progress.cancel_button.clicked.connect(self.cancel)

    def refresh(self) -> None:
        """Say in what the selected class is looked at, and enable what can be done about it."""
        ui, session, selected = self.ui, self.session, self.selected
        ready = session is not None and session.phase == "ready"
        words = "" if session is None or selected is None else session.close_ups.text(selected)
        ui.lookCloserButton.enabled = ready and selected is not None and bool(selected.positive)
        ui.lookAtWholeButton.enabled = ui.closeUpLabel.visible = bool(words)
        ui.closeUpLabel.text = words
        reason = None if session is None or selected is None else session.close_up_hints.of(selected)
        # In a close-up, what is said is why there is one.
        self._suggest(closer_look_text(reason), press=not ui.lookAtWholeButton.enabled)
        looks_closer = session is not None and session.looks_closer
        self._progress.show(session.progress if session is not None and looks_closer else None)
        told, self._tells = self._tells, bool(reason) or looks_closer
        if self._tells and not told:
            self._bring_into_sight()

    def _bring_into_sight(self) -> None:
        """Show what is told of a closer look to who works in the views.

        On a small screen, it lies below what the panel shows, and nothing would seem to be said, or to happen.
        """
        ui = self.ui
        hint, area = ui.closeUpHintLabel, scroll_area_of(ui.lookCloserButton)
        if area is not None and not area.underMouse():
            lines = ui.closeUpLabel.sizeHint.height() + max(hint.heightForWidth(hint.parent().width), hint.sizeHint.height())
            bring_into_sight(ui.lookCloserButton, ui.lookCloserButton.height + lines + ui.closeUpProgressRow.sizeHint.height())

    def _suggest(self, words: str, press: bool) -> None:
        """Say why a closer look helps, or say nothing (""): a line below *Look closer*, and nothing that has to be closed.

        `press`: that is for the user to press.
        """
        ui, suggested = self.ui, bool(words) and press
        if suggested != self._suggested:
            self._suggested = suggested
            # No style sheet: when Slicer goes from its light style to its dark one, text under one stays black.
            font = qt.QFont()
            if suggested:
                font.setBold(True)
            ui.lookCloserButton.font = font
        ui.closeUpHintLabel.visible = bool(words)
        ui.closeUpHintLabel.text = words

    def look_closer(self) -> None:
        """Look at a box around the structure, fitted to what is shown of it now."""
        self.with_selected(lambda session, id_: session.close_ups.look_closer(id_))

    def look_at_whole(self) -> None:
        """Look at the whole volume again."""
        self.with_selected(lambda session, id_: session.close_ups.look_at_whole(id_))
