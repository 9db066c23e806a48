"""Boxes for numbers: they keep no key to themselves that a number has no use for, and know a decimal comma."""

from __future__ import annotations

from typing import Any

import qt

from ViTTransferFunction.Logic.scene.interface.shortcuts import SHORTCUTS

_TYPED = {shortcut.key[-1].lower() for shortcut in SHORTCUTS if shortcut.key != "Esc"}
"""What the keys of the module type where something is typed."""


class NumberBoxes(qt.QObject):
    """Has boxes for numbers leave the module's keys to it and take a comma for a point, for as long as this object is kept.

    A box has it from the time when somebody types a number there or presses one of its arrows, such as for the size of the
    brush or the place of a slice, until they click elsewhere. Qt asks who has the keyboard first whether a key is theirs, and
    a box takes every letter, though it types none.

    Slicer's numbers have a point in every language (QLocale::C). A comma, which is all that many keyboards have beside their
    digits, would be lost or be taken for one between thousands: 12,5 would be 125.

    Args:
        windows: the windows that have the boxes.
    """

    def __init__(self, windows: list[Any]) -> None:
        qt.QObject.__init__(self)
        for window in windows:
            for box in (*window.findChildren(qt.QSpinBox), *window.findChildren(qt.QDoubleSpinBox)):
                box.installEventFilter(self)

    def eventFilter(self, box: Any, event: Any) -> bool:  # noqa: N802
        """Called by Qt: whether a box is not to be told of something."""
        if event.type() == qt.QEvent.KeyPress and event.text() == "," and box.inherits("QDoubleSpinBox"):
            box.findChild(qt.QLineEdit).insert(".")
            return True
        return event.type() == qt.QEvent.ShortcutOverride and event.text().lower() in _TYPED
