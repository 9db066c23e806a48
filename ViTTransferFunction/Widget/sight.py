"""What the user is to see of the panel, which may be scrolled elsewhere."""

from __future__ import annotations

from typing import Any

import qt


def scroll_area_of(widget: Any) -> Any:
    """The scroll area that a widget of the panel lies in; None where it lies in none."""
    area = widget.parent()
    while area is not None and not area.inherits("QScrollArea"):
        area = area.parent()
    return area


def bring_into_sight(widget: Any, height: int) -> None:
    """Scroll the panel as little as it takes to show so many pixels from a widget's top on; of too many, the first ones.

    What was shown a moment ago has no place yet: give what is above it, and the height of both.
    """
    area = scroll_area_of(widget)
    if area is not None:
        top = widget.mapTo(area.widget(), qt.QPoint(0, 0)).y()
        area.ensureVisible(0, top + height, 0, 0)
        area.ensureVisible(0, top, 0, 0)
