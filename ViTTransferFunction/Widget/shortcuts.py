"""Keys that work while the module is open.

None but [ and ] is one that Slicer itself uses in its windows and views: f, b, g, t, r, s, v, i and the arrows in the views,
and Ctrl with a letter or a digit in the main window. With [ and ] a slice view shows the previous and the next volume, which
nobody wants while marking structures in one. Undo, redo and the choice of the structure are on the keys of the Segment Editor.
"""

from __future__ import annotations

import html
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import qt
import slicer
from slicer.i18n import tr as _


@dataclass(frozen=True)
class Shortcut:
    """A key, what it does, and whose tool tip names it.

    Attributes:
        key: as Qt writes it.
        action: its name among the actions.
        button: name of the button that does the same; "" where there is none.
    """

    key: str
    action: str
    button: str = ""


SHORTCUTS: tuple[Shortcut, ...] = (
    Shortcut("A", "pointOn", "pointOnButton"),
    Shortcut("N", "pointOff", "pointOffButton"),
    Shortcut("Shift+A", "brushOn", "brushOnButton"),
    Shortcut("Shift+N", "brushOff", "brushOffButton"),
    Shortcut("L", "lassoOn", "lassoOnButton"),
    Shortcut("Shift+L", "lassoOff", "lassoOffButton"),
    Shortcut("D", "boxOn", "boxOnButton"),
    Shortcut("Shift+D", "boxOff", "boxOffButton"),
    Shortcut("E", "eraser", "eraserButton"),
    Shortcut("Esc", "putDown"),
    Shortcut("Z", "undo", "undoButton"),
    Shortcut("Y", "redo", "redoButton"),
    Shortcut("X", "removeLast", "removeLastButton"),
    Shortcut("[", "smaller", "smallerButton"),
    Shortcut("]", "larger", "largerButton"),
    Shortcut("Q", "previousClass"),
    Shortcut("W", "nextClass"),
    Shortcut("J", "nextPoint"),
    Shortcut("?", "help"),
)

TABLE_KEYS: dict[str, str] = {"rename": "F2", "moveUp": "Alt+Up", "moveDown": "Alt+Down", "remove": "Del"}
"""Keys of the table of structures, by action: they work only while it has the focus."""


def meanings() -> dict[str, str]:
    """What each action does, for users."""
    return {
        "pointOn": _("place points inside the structure"),
        "pointOff": _("place points outside the structure"),
        "brushOn": _("brush over the inside"),
        "brushOff": _("brush over the outside"),
        "lassoOn": _("lasso a part of the structure"),
        "lassoOff": _("lasso what is not the structure"),
        "boxOn": _("draw a box in the structure"),
        "boxOff": _("draw a box outside the structure"),
        "eraser": _("erase points"),
        "putDown": _("put the tool down"),
        "undo": _("undo"),
        "redo": _("redo"),
        "removeLast": _("remove the last point"),
        "smaller": _("make the structure smaller"),
        "larger": _("make the structure larger"),
        "previousClass": _("select the structure above"),
        "nextClass": _("select the structure below"),
        "nextPoint": _("show the next point of the structure"),
        "help": _("show or hide this list"),
        "rename": _("rename the structure"),
        "moveUp": _("move the structure up"),
        "moveDown": _("move the structure down"),
        "remove": _("remove the structure"),
    }


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
            self.installed = [self._make(shortcut, window) for window in self._windows() for shortcut in SHORTCUTS]

    def remove(self) -> None:
        """Leave the keys to others."""
        for shortcut in self.installed:
            shortcut.enabled = False
            shortcut.setParent(None)
            shortcut.deleteLater()
        self.installed = []

    def _make(self, shortcut: Shortcut, window: Any) -> Any:
        made = qt.QShortcut(qt.QKeySequence(shortcut.key), window)
        made.activated.connect(self._actions[shortcut.action])
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
    wheel = _row(_("Ctrl+wheel"), _("over the structure in a slice: smaller or larger; elsewhere it zooms"))
    of_table = [_row(key, meanings()[action]) for action, key in TABLE_KEYS.items()]
    of_mouse = [_heading(_("With the mouse:")), wheel]
    return f"<table>{''.join([*rows, *of_mouse, _heading(_('In the table of structures:')), *of_table])}</table>"


def _heading(text: str) -> str:
    return f"<tr><td colspan='2'><br>{html.escape(text)}</td></tr>"


def _row(key: str, meaning: str) -> str:
    return f"<tr><td><b>{html.escape(key)}</b>&nbsp;&nbsp;</td><td>{html.escape(meaning)}</td></tr>"
