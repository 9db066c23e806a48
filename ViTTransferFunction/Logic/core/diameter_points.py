"""Points that a diameter stands for: a line drawn across a structure, from where it begins to where it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import InputError

INSIDE = (0.5, 0.25, 0.75)
"""Places along the line, as shares of it: the middle first, which is the most typical of the structure."""
BEYOND = 0.2
"""How far beyond its ends the structure is surely over, as a share of the line: hands are not exact, nor are edges sharp."""
LEAST_BEYOND_MM = 2.0
"""But not less: a voxel or two."""
SHORTEST_MM = 0.5
"""What is shorter was not drawn across anything."""
_SAME_MM = 1e-3
"""Points that a transform has moved, or that come from a file, are rounded by less."""


@dataclass(frozen=True)
class PlacedDiameter:
    """A diameter whose points are among those of a structure.

    Attributes:
        length_mm: of the line.
        inside_until: how many of the structure's points inside there were with its own.
        outside_until: and how many of those outside.
    """

    length_mm: float
    inside_until: int
    outside_until: int


def points_of_diameter(ends_ras: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points inside a structure, along a line across it, and points outside, beyond both ends of the line.

    Args:
        ends_ras: (2, 3) RAS millimetres, on the structure's edge.

    Returns:
        (3, 3) points inside and (2, 3) points outside, RAS millimetres, each in the order in which they count.

    Raises:
        InputError: the line is shorter than `SHORTEST_MM`.
    """
    start, end = np.asarray(ends_ras, dtype=np.float64)
    length_mm = float(np.linalg.norm(end - start))
    if not length_mm >= SHORTEST_MM:
        raise InputError(
            f"The diameter is {length_mm:.2g} mm long; at least {SHORTEST_MM:g} mm were expected. Drag from one edge of the "
            "structure to the other, where it is longest."
        )
    inside = start + np.array(INSIDE)[:, None] * (end - start)
    return inside, _beyond(start, end, length_mm)


def last_diameter(inside_ras: np.ndarray, outside_ras: np.ndarray) -> PlacedDiameter | None:
    """Of the diameters that are among points, the one that was placed last; None where there is none.

    Only one whose points are all there, and where it placed them.

    Args:
        inside_ras: (N, 3) RAS millimetres, in the order in which they were placed.
        outside_ras: (M, 3), the same.
    """
    middles, starts, ends = inside_ras[:-2], inside_ras[1:-1], inside_ras[2:]
    for index in np.flatnonzero(_is_same(starts + ends, 2.0 * middles))[::-1]:
        along = (ends[index] - starts[index]) / (INSIDE[2] - INSIDE[1])
        length_mm = float(np.linalg.norm(along))
        if length_mm < SHORTEST_MM:
            continue  # A point that was placed three times.
        start = starts[index] - INSIDE[1] * along
        before, after = _beyond(start, start + along, length_mm)
        places = np.flatnonzero(_is_same(outside_ras[:-1], before) & _is_same(outside_ras[1:], after))
        if places.size:
            return PlacedDiameter(length_mm, int(index) + len(INSIDE), int(places[-1]) + 2)
    return None


def _beyond(start: np.ndarray, end: np.ndarray, length_mm: float) -> np.ndarray:
    """(2, 3): the points outside."""
    beyond = max(BEYOND * length_mm, LEAST_BEYOND_MM) / length_mm * (end - start)
    return np.stack([start - beyond, end + beyond])


def _is_same(some_ras: np.ndarray, others_ras: np.ndarray) -> np.ndarray:
    """(N,) bool: which of some points (N, 3) are where others are."""
    same: np.ndarray = np.abs(some_ras - others_ras).max(axis=1, initial=0.0) <= _SAME_MM
    return same
