"""The list of all keys, in a small window that stays beside the views while one works."""

from __future__ import annotations

from typing import Any

import qt
from slicer.i18n import tr as _

from ViTTransferFunction.Widget.shortcuts import shortcuts_table


class ShortcutHelp:
    """Opens and closes the list. It leaves the keyboard to the main window, so that the keys can be tried while it is open.

    Args:
        parent: the main window.
    """

    def __init__(self, parent: Any) -> None:
        self._window = qt.QDialog(parent)
        # While a tool window is active, the keys of its main window go on working: those that close it among them.
        self._window.setWindowFlags(qt.Qt.Tool)
        self._window.windowTitle = _("Keyboard shortcuts")
        self._window.toolTip = _("Keys that work while this module is open. Esc or ? closes the list.")
        self._window.setAttribute(qt.Qt.WA_ShowWithoutActivating)
        label = qt.QLabel(shortcuts_table(), self._window)
        label.textFormat = qt.Qt.RichText
        qt.QVBoxLayout(self._window).addWidget(label)

    def toggle(self) -> None:
        """Show the list, or hide it if it is shown."""
        if not self.close():
            self._window.show()

    def close(self) -> bool:
        """Hide the list; returns whether it was shown."""
        shown = bool(self._window.visible)
        self._window.hide()
        return shown
