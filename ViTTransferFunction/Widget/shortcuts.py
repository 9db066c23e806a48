"""Has the keys of `Logic/scene/interface/shortcuts.py` work while the module is open, and lists them."""

from __future__ import annotations

import html
import sys
from collections.abc import Callable
from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.scene.interface.shortcuts import SHORTCUTS, TABLE_KEYS, WHILE_HELD, meanings
from ViTTransferFunction.Widget.number_boxes import NumberBoxes

OF_OTHER_PROGRAMS = {"Ctrl+Z": "undo", "Ctrl+Y": "redo", "Ctrl+Shift+Z": "redo"}
"""Keys that other programs have for these actions, and Slicer's Segment Editor; its main window has them on no menu and no tool
bar, where they do nothing."""


class Shortcuts:
    """Installs the keys for as long as the module is open.

    They work in the main window and in every other window with views, and in no dialog.

    Args:
        ui: the widgets of the panel, by name: their tool tips and the list of shortcuts name the keys.
        parent: the main window.
        actions: what to do, by the name of the action.
    """

    def __init__(self, ui: Any, parent: Any, actions: dict[str, Callable[[], None]]) -> None:
        self._parent = parent
        self._actions = actions
        self.installed: list[Any] = []
        self._number_boxes: NumberBoxes | None = None
        layout_manager = slicer.app.layoutManager()
        if layout_manager is not None:
            layout_manager.layoutChanged.connect(self._on_layout_changed)
        ui.shortcutsLabel.text = shortcuts_table()
        for shortcut in SHORTCUTS:
            if shortcut.button:
                button = getattr(ui, shortcut.button)
                button.toolTip = _("{tip} Key: {key}").format(tip=button.toolTip, key=shortcut.key)

    def install(self) -> None:
        """Let the keys work."""
        if not self.installed:
            keys = [*((shortcut.key, shortcut.action) for shortcut in SHORTCUTS), *OF_OTHER_PROGRAMS.items()]
            windows = self._windows()
            self.installed = [self._make(key, action, window) for window in windows for key, action in keys]
            self._number_boxes = NumberBoxes(windows)

    def remove(self) -> None:
        """Leave the keys to others."""
        for shortcut in self.installed:
            shortcut.enabled = False
            shortcut.setParent(None)
            shortcut.deleteLater()
        self.installed = []
        self._number_boxes = None

    def _make(self, key: str, action: str, window: Any) -> Any:
        made = qt.QShortcut(qt.QKeySequence(key), window)
        made.autoRepeat = action in WHILE_HELD
        made.activated.connect(self._actions[action])
        return made

    def _windows(self) -> list[Any]:
        """The main window, and those in which Slicer puts views of other monitors."""
        windows = [self._parent]
        layout_manager = slicer.app.layoutManager()
        for view in layout_manager.viewWidgets() if layout_manager is not None else ():
            window = view.window()
            # To Qt, a floating dock is part of the main window: with keys of its own, each would be there twice.
            if window not in windows and not window.inherits("QDockWidget"):
                windows.append(window)
        return windows

    def _on_layout_changed(self) -> None:
        # Another layout may have other windows.
        if self.installed:
            self.remove()
            self.install()


def shortcuts_table() -> str:
    """The list of keys, as rich text."""
    rows = [_row(shortcut.key, meanings()[shortcut.action]) for shortcut in SHORTCUTS]
    # What Qt calls Ctrl is the command key there.
    key = _("Cmd+wheel") if sys.platform == "darwin" else _("Ctrl+wheel")
    wheel = _row(key, _("over the structure in a slice: smaller or larger; elsewhere it zooms"))
    of_table = [_row(key, meanings()[action]) for action, key in TABLE_KEYS.items()]
    of_mouse = [_heading(_("With the mouse:")), wheel]
    return f"<table>{''.join([*rows, *of_mouse, _heading(_('In the table of structures:')), *of_table])}</table>"


def _heading(text: str) -> str:
    return f"<tr><td colspan='2'><br>{html.escape(text)}</td></tr>"


def _row(key: str, meaning: str) -> str:
    return f"<tr><td><b>{html.escape(key)}</b>&nbsp;&nbsp;</td><td>{html.escape(meaning)}</td></tr>"
