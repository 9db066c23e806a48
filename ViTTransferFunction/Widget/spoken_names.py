"""What screen readers and dictation call a slider, list or box: to Qt, the label beside it has nothing to do with it."""

from __future__ import annotations

from typing import Any

import qt

_SAY_THEMSELVES = ("QAbstractButton", "QLabel")


def name_as_labelled(ui: Any) -> None:
    """Give fields the names that stand beside them; those that have signs or nothing there have theirs in the form.

    A field of Slicer's consists of others, one of which gets the keyboard.

    Args:
        ui: the widgets of the panel, by name.
    """
    for name, field in vars(ui).items():
        label = getattr(ui, f"{name}Label", None)
        if label is not None and field.inherits("QWidget") and not any(map(field.inherits, _SAY_THEMSELVES)):
            for part in (field, *field.findChildren(qt.QWidget)):
                part.accessibleName = label.text.rstrip(":")
