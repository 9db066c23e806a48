"""When a structure that begins with an outline is looked at closely at once: it is small, and shown as something else.

The outline is the truth in one slice. Where the whole volume shows the structure as it was outlined there, a close-up makes it
no better, and often worse, however small it is; where it does not, most structures gain.
"""

from __future__ import annotations

import numpy as np

from .class_map import ClassMap, is_inside
from .diameter_points import BEYOND
from .outlines import evenly, plane_through, winding
from .region_points import points_of_outline

SMALL_CELLS = 4.0
"""A diameter or an outline of fewer cells is small; see `Benchmarks/results/candidates.md`, from *A diameter instead of the
first click* on."""
LEAST_AGREEMENT = 0.8
"""Below this Dice in the slice of its outline, a structure is shown as something else: chosen on AMOS 336 and the brain, see
`Benchmarks/results/candidates.md`, *Looked at closely without being asked*."""

_WINDOW = 3.0
"""Edge of the square around an outline in which it is compared, in sizes of the outline: enough to see a flood."""
_PLACES = 96
"""Along each edge of the square."""


def asks_for_close_up(shown: ClassMap, outline_ras: np.ndarray, cell_mm: float) -> bool:
    """Whether a structure is to be looked at closely at once.

    Args:
        shown: the structure as the whole volume shows it, refined: cells are too large to be compared with what is small.
        outline_ras: (N, 3) RAS millimetres in the frame of the map, as for `points_of_outline`, which it begins with.
        cell_mm: the longest edge of the whole volume's cells.
    """
    points = np.concatenate(points_of_outline(outline_ras))
    return is_small(points, cell_mm) and agreement(shown, outline_ras) < LEAST_AGREEMENT


def is_small(points_ras: np.ndarray, cell_mm: float) -> bool:
    """Whether a diameter or an outline is small for the cells, by the points (N, 3) that it stands for, RAS millimetres."""
    farthest_mm = float(np.linalg.norm(points_ras[:, None] - points_ras, axis=-1).max())
    # What lies off the structure is so much farther apart than the structure is long.
    return farthest_mm / (1.0 + 2.0 * BEYOND) < SMALL_CELLS * cell_mm


def agreement(shown: ClassMap, outline_ras: np.ndarray) -> float:
    """Dice of what a map shows and what an outline encloses, in the outline's plane, in a square around it.

    Args:
        shown: beyond its grid, nothing is.
        outline_ras: (N, 3) RAS millimetres in the map's frame; encloses an area.
    """
    centre_ras, axes = plane_through(outline_ras)
    outline = evenly((outline_ras - centre_ras) @ axes.T)
    low, high = outline.min(axis=0), outline.max(axis=0)
    steps = ((np.arange(_PLACES) + 0.5) / _PLACES - 0.5) * _WINDOW * (high - low).max()
    places = (low + high) / 2.0 + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    enclosed = winding(places, outline) != 0
    places_ras = centre_ras + places @ axes
    inside = shown.geometry.contains(places_ras)
    inside[inside] = is_inside(shown, places_ras[inside])
    return float(2.0 * (enclosed & inside).sum() / max(enclosed.sum() + inside.sum(), 1))
