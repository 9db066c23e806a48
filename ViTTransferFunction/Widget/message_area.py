"""Where errors are shown: in the panel, once each, until the user closes them."""

from __future__ import annotations

from typing import Any


class MessageArea:
    """Hidden while there is nothing to tell.

    Args:
        ui: the widgets of the panel, by name.
    """

    def __init__(self, ui: Any) -> None:
        self._frame, self._label = ui.messageFrame, ui.messageLabel
        ui.messageCloseButton.clicked.connect(self.close)
        self.close()

    def show(self, message: str) -> None:
        """Show a message in place of the one before."""
        self._label.text = f"⚠ {message}"
        self._frame.visible = True

    def close(self) -> None:
        """Show nothing."""
        self._label.text = ""
        self._frame.visible = False
