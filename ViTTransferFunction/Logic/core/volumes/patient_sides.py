"""The patient's sides by their letters: those that lie around a slice, and where a position is."""

from __future__ import annotations

import numpy as np

SIDES = (("L", "R"), ("P", "A"), ("I", "S"))
"""The patient's sides at the lower and upper end of each axis of RAS."""


def sides(slice_to_ras: np.ndarray) -> dict[str, str]:
    """The patient's side nearest to each edge of a slice view and to both ends of its slider: R or L, A or P, S or I.

    Args:
        slice_to_ras: (4, 4); its first two columns are where right and up on the screen lead in the patient, its third where
            larger offsets of the slice do.
    """
    right, up, ahead = (nearest_side(slice_to_ras[:3, column]) for column in range(3))
    left, down, behind = (nearest_side(-slice_to_ras[:3, column]) for column in range(3))
    return {"left": left, "right": right, "top": up, "bottom": down, "positive": ahead, "negative": behind}


def position_text(point_ras: np.ndarray, decimals: int = 0) -> str:
    """A position (3,), RAS millimetres, for users: R 98, A 164, S 394."""
    return ", ".join(
        f"{letters[int(round(value, decimals) >= 0)]} {abs(value):.{decimals}f}"
        for letters, value in zip(SIDES, point_ras, strict=True)
    )


def nearest_side(vector_ras: np.ndarray) -> str:
    """The patient's side that a direction (3,) RAS leads to, more than to any other."""
    axis = int(np.abs(vector_ras).argmax())
    return SIDES[axis][int(vector_ras[axis] > 0.0)]
