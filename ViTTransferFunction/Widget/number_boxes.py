"""Boxes for numbers, which keep no key to themselves that a number has no use for."""

from __future__ import annotations

from typing import Any

import qt

from ViTTransferFunction.Logic.scene.interface.shortcuts import SHORTCUTS

_TYPED = {shortcut.key[-1].lower() for shortcut in SHORTCUTS if shortcut.key != "Esc"}
"""What the keys of the module type where something is typed."""


class NumberBoxes(qt.QObject):
    """Leaves the keys of the module to it also while a box for a number has the keyboard, for as long as this object is kept.

    A box has it from the time when somebody types a number there or presses one of its arrows, such as for the size of the
    brush or the place of a slice, until they click elsewhere. Qt asks who has the keyboard first whether a key is theirs, and
    a box takes every letter, though it types none.

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
        return event.type() == qt.QEvent.ShortcutOverride and event.text().lower() in _TYPED
