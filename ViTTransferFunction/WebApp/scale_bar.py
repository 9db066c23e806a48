"""The bar in a slice view that tells how long something in it is, as viewers of scans have one."""

from __future__ import annotations

import math
from typing import Any

from ..Logic.core.volumes.measures import round_number

LARGEST_SHARE = 0.25
"""Of the view's width."""


def scale_bar(view_mm: float) -> dict[str, Any]:
    """The longest bar of 1, 2 or 5 times a power of ten that takes a quarter of a view or less.

    Args:
        view_mm: how much of the patient the view is wide, in millimetres.

    Returns:
        "share", the bar's of the view's width, and "text", its length; 0 and "" where the view shows nothing.
    """
    if not (math.isfinite(view_mm) and view_mm > 0.0):
        return {"share": 0.0, "text": ""}
    length_mm = round_number(LARGEST_SHARE * view_mm)
    return {"share": length_mm / view_mm, "text": _length_text(length_mm)}


def _length_text(length_mm: float) -> str:
    if length_mm >= 9.99:
        return f"{length_mm / 10.0:.6g} cm"
    return f"{length_mm:.6g} mm" if length_mm >= 0.999 else f"{1000.0 * length_mm:.6g} µm"
