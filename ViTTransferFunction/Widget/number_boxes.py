"""The panel's boxes for numbers, which keep no key to themselves that a number has no use for."""

from __future__ import annotations

from typing import Any

import qt

from ViTTransferFunction.Logic.scene.shortcuts import SHORTCUTS

_TYPED = {shortcut.key[-1].lower() for shortcut in SHORTCUTS if shortcut.key != "Esc"}
"""What the keys of the module type where something is typed."""


class NumberBoxes(qt.QObject):
    """Leaves the keys of the module to it also while a box for a number has the keyboard.

    It has it from the time when somebody types a number there or presses one of its arrows, such as for the size of the brush,
    until they click elsewhere; and Qt asks who has the keyboard first, who takes every letter, and then types none.

    Args:
        panel: the widget that has the boxes.
    """

    def __init__(self, panel: Any) -> None:
        qt.QObject.__init__(self)
        for box in panel.findChildren(qt.QAbstractSpinBox):
            box.installEventFilter(self)

    def eventFilter(self, box: Any, event: Any) -> bool:  # noqa: N802
        """Called by Qt: whether a box is not to be told of something."""
        return event.type() == qt.QEvent.ShortcutOverride and event.text().lower() in _TYPED
