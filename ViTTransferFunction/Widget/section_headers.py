"""Headers of the panel's sections: keys that a section's content has no use for are not theirs."""

from __future__ import annotations

from typing import Any

import qt

_KEYS = ("Key_Up", "Key_Down", "Key_Left", "Key_Right", "Key_Space")
"""That a button reacts to."""


class SectionHeaders(qt.QObject):
    """Has headers react to keys only while they have the keyboard themselves, for as long as this object is kept.

    To Qt, a section is a button with its content inside, and keys that nothing in it takes go to the button: with the arrow
    upwards in the first row of a table, the keyboard would leave it for another section's header, which Space closes.

    Args:
        ui: the widgets of the panel, by name.
    """

    def __init__(self, ui: Any) -> None:
        qt.QObject.__init__(self)
        self._keys = [getattr(qt.Qt, name) for name in _KEYS]
        for name, widget in vars(ui).items():
            if name.endswith("CollapsibleButton"):
                widget.installEventFilter(self)

    def eventFilter(self, header: Any, event: Any) -> bool:  # noqa: N802
        """Called by Qt: whether a header is not to be told of something; what is above it is told of the key."""
        if event.type() != qt.QEvent.KeyPress or header.focus or event.key() not in self._keys:
            return False
        event.ignore()
        return True
