"""Where errors are shown: in the panel, once each, until their cause is gone or the user closes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class MessageArea:
    """Hidden while there is nothing to tell.

    Args:
        ui: the widgets of the panel, by name.
    """

    def __init__(self, ui: Any) -> None:
        self._frame, self._label = ui.messageFrame, ui.messageLabel
        self._shown: dict[str, Callable[[], bool]] = {}
        ui.messageCloseButton.clicked.connect(self.close)
        self.close()

    def show(self, message: str, solved: Callable[[], bool]) -> None:
        """Show a message below those that stand already; `refresh` takes it away once it is `solved`."""
        self._shown.pop(message, None)
        self._shown[message] = solved
        self.refresh()

    def refresh(self) -> None:
        """Show what is not solved yet."""
        self._shown = {message: solved for message, solved in self._shown.items() if not solved()}
        self._label.text = "\n\n".join(f"⚠ {message}" for message in self._shown)
        self._frame.visible = bool(self._shown)

    def close(self) -> None:
        """Show nothing."""
        self._shown = {}
        self.refresh()
