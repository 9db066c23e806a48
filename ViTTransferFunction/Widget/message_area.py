"""Where errors are shown: in the panel, once each, until their cause is gone or the user closes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import qt

from ViTTransferFunction.Logic.scene.messages import Messages
from ViTTransferFunction.Widget.wording import breakable


class MessageArea:
    """Hidden while there is nothing to tell.

    Args:
        ui: the widgets of the panel, by name.
    """

    def __init__(self, ui: Any) -> None:
        self._frame, self._label = ui.messageFrame, ui.messageLabel
        self._messages = Messages()
        ui.messageCloseButton.clicked.connect(self.close)
        self.close()

    def show(self, message: str, solved: Callable[[], bool]) -> None:
        """Show a message below those that stand already; `refresh` takes it away once it is `solved`."""
        self._messages.put(message, solved)
        self.refresh()
        self._bring_into_sight()

    def refresh(self) -> None:
        """Show what is not solved yet."""
        standing = self._messages.standing()
        self._label.text = breakable("\n\n".join(f"⚠ {message}" for message in standing))
        self._frame.visible = bool(standing)

    def close(self) -> None:
        """Show nothing."""
        self._messages.clear()
        self.refresh()

    def _bring_into_sight(self) -> None:
        """Messages are at the top of the panel, which may be scrolled down to the button that was pressed."""
        area = panel = self._frame.parent()
        while area is not None and not area.inherits("QScrollArea"):
            area = area.parent()
        if area is not None:
            # Of the panel, not of the frame, which Qt has not given its place yet.
            top = panel.mapTo(area.widget(), qt.QPoint(0, 0)).y()
            area.ensureVisible(0, top, 0, self._frame.sizeHint.height())
