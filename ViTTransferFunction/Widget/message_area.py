"""Where errors are shown: in the panel, once each, until their cause is gone or the user closes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ViTTransferFunction.Logic.scene.interface.messages import Messages
from ViTTransferFunction.Widget.sight import bring_into_sight
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

    def show(self, message: str, solved: Callable[[], bool], about: str = "") -> None:
        """Show a message below those that stand already; `refresh` takes it away once it is `solved`. See `Messages`."""
        self._messages.put(message, solved, about)
        self.refresh()
        self.bring_into_sight()

    def bring_into_sight(self) -> None:
        """Have the panel show them: they are at its top, and it may be scrolled down to the button that was pressed."""
        parent = self._frame.parent()
        # By itself, it would be as narrow as the button in it, and higher than the panel.
        bring_into_sight(parent, self._frame.heightForWidth(parent.width))

    def try_again(self, about: str) -> None:
        """Forget why something was not done that is tried once more."""
        self._messages.try_again(about)
        self.refresh()

    def refresh(self) -> None:
        """Show what is not solved yet."""
        standing = self._messages.standing()
        self._label.text = breakable("\n\n".join(f"⚠ {message}" for message in standing))
        self._frame.visible = bool(standing)

    def close(self) -> None:
        """Show nothing."""
        self._messages.clear()
        self.refresh()


class ErrorReport:
    """What sections of the panel show errors by, as `Report` in `section.py` says.

    Args:
        messages: where they are shown.
        state: what is another one when the user has gone on: the structures.
    """

    def __init__(self, messages: MessageArea, state: Callable[[], Any]) -> None:
        self._messages, self._state = messages, state
        self.try_again = messages.try_again

    def __call__(self, message: str, solved: Callable[[], bool] | None = None, about: str = "") -> None:
        """Show one."""
        before = self._state()
        self._messages.show(message, solved or (lambda: self._state() != before), about)
