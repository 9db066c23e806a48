"""The keys of every front end: those that work anywhere in its window, and those of its table of structures.

None but [, ] and Esc is one that Slicer itself uses in its windows and views: f, b, g, t, r, s, v, i and the arrows in the
views, and Ctrl with a letter or a digit in the main window. With [ and ] a slice view shows the previous and the next volume,
which nobody wants while marking structures in one; Esc gives up what the mouse is dragging in a view. Undo, redo and the choice
of the structure are on the keys of the Segment Editor.
"""

from __future__ import annotations

from dataclasses import dataclass

from .translation import tr as _


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
    Shortcut("O", "outline", "outlineButton"),
    Shortcut("M", "diameter", "diameterButton"),
    Shortcut("E", "eraser", "eraserButton"),
    Shortcut("Esc", "putDown"),
    Shortcut("Z", "undo", "undoButton"),
    Shortcut("Y", "redo", "redoButton"),
    Shortcut("X", "removeLast", "removeLastButton"),
    Shortcut("[", "smaller", "smallerButton"),
    Shortcut("]", "larger", "largerButton"),
    Shortcut("C", "lookCloser", "lookCloserButton"),
    Shortcut("Q", "previousClass"),
    Shortcut("W", "nextClass"),
    Shortcut("J", "nextPoint"),
    Shortcut("?", "help"),
)

TABLE_KEYS: dict[str, str] = {"rename": "F2", "moveUp": "Alt+Up", "moveDown": "Alt+Down", "remove": "Del"}
"""Keys of the table of structures, by action: they work only while it has the focus."""

WHILE_HELD = frozenset(
    ("undo", "redo", "removeLast", "smaller", "larger", "previousClass", "nextClass", "nextPoint", "moveUp", "moveDown")
)
"""Actions that are done again and again while their key is held down. All others are done once: a tool would be taken up and
put down in turn, and be in hand at the end or not; structure after structure would be removed."""


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
        "outline": _("drag once around the structure, along its edge"),
        "diameter": _("drag a line across the structure, from edge to edge"),
        "eraser": _("erase points"),
        "putDown": _("put the tool down"),
        "undo": _("undo"),
        "redo": _("redo"),
        "removeLast": _("remove the last point"),
        "smaller": _("make the structure smaller"),
        "larger": _("make the structure larger"),
        "lookCloser": _("look closer at the structure"),
        "previousClass": _("select the structure above"),
        "nextClass": _("select the structure below"),
        "nextPoint": _("show the next point of the structure"),
        "help": _("show or hide this list"),
        "rename": _("rename the structure"),
        "moveUp": _("move the structure up"),
        "moveDown": _("move the structure down"),
        "remove": _("remove the structure"),
    }
