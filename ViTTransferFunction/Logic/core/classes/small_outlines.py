"""When a structure that begins with an outline is looked at closely at once: it is small, and shown as something else.

The outline is the truth in one slice. Where the whole volume shows the structure as it was outlined there, a close-up makes it
no better, and often worse, however small it is; where it does not, most structures gain.
"""

from __future__ import annotations

import numpy as np

from ..system.errors import InputError
from ..volumes.geometry import Geometry
from .class_map import ClassMap, in_units_of
from .close_up import CloseUp
from .close_up_choice import close_up_of
from .diameter_points import BEYOND
from .outlines import evenly, plane_through, winding
from .region_points import points_of_outline

SMALL_CELLS = 4.0
"""A diameter or an outline of fewer cells is small; see `Benchmarks/results/candidates.md`, from *A diameter instead of the
first click* on."""
LEAST_AGREEMENT = 0.8
"""Below this Dice in the slice of its outline, a structure is shown as something else: chosen on AMOS 336 and the brain, see
`Benchmarks/results/candidates.md`, *Looked at closely without being asked*."""

REACH = 0.5
"""Of an outline's length, how far the structure is taken to reach beyond it where its box is chosen: what is shown is wrong
there, and often a flood. A smaller box has smaller cells, and less of elsewhere. Chosen on AMOS 336."""

_PLACES = 32
"""Along an outline: where it is compared with what is shown."""
_MOST_PLACES = 250_000
"""In all, where what is shown is very much larger than the outline: done in a tenth of a second."""


def unasked_close_up(
    shown: ClassMap, outline_ras: np.ndarray, points_ras: np.ndarray, geometry: Geometry, cell_mm: float
) -> CloseUp | None:
    """The box in which a structure is to be looked at closely at once; None: it stays in the whole volume.

    Args:
        shown: as for `asks_for_close_up`.
        outline_ras: as there.
        points_ras: the structure's positive points (N, 3), N ≥ 1.
        geometry: of the volume.
        cell_mm: as there.
    """
    scale = geometry.body_scale
    if not asks_for_close_up(shown, outline_ras, cell_mm, scale):
        return None
    try:
        return close_up_of(shown, points_ras, geometry, reach_mm(outline_ras, scale))
    except InputError:
        return None  # The box would show little else than the whole.


def asks_for_close_up(shown: ClassMap, outline_ras: np.ndarray, cell_mm: float, scale: float) -> bool:
    """Whether a structure is to be looked at closely at once.

    Args:
        shown: the structure as the whole volume shows it, refined: cells are too large to be compared with what is small.
        outline_ras: (N, 3) RAS millimetres in the frame of the map, as for `points_of_outline`, which it begins with.
        cell_mm: the longest edge of the whole volume's cells.
        scale: as for `points_of_outline`.
    """
    points = np.concatenate(points_of_outline(outline_ras, scale))
    return is_small(points, cell_mm) and agreement(shown, outline_ras) < LEAST_AGREEMENT


def is_small(points_ras: np.ndarray, cell_mm: float) -> bool:
    """Whether a diameter or an outline is small for the cells, by the points (N, 3) that it stands for, RAS millimetres."""
    return _length_mm(points_ras) < SMALL_CELLS * cell_mm


def reach_mm(outline_ras: np.ndarray, scale: float) -> float:
    """How far a structure that begins with an outline (N, 3) and is shown as something else may reach (`close_up_of`)."""
    return REACH * _length_mm(np.concatenate(points_of_outline(outline_ras, scale)))


def agreement(shown: ClassMap, outline_ras: np.ndarray) -> float:
    """Dice of what a map shows and what an outline encloses, in all of the outline's plane.

    Args:
        shown: of a segment, of whose voxels those above the iso value are (`SegmentCrops`); beyond its grid, nothing is.
        outline_ras: (N, 3) RAS millimetres in the map's frame; encloses an area.
    """
    centre_ras, axes = plane_through(outline_ras)
    outline = evenly((outline_ras - centre_ras) @ axes.T)
    low, high = outline.min(axis=0), outline.max(axis=0)
    places = _places(low, high, (_corners_ras(shown.geometry) - centre_ras) @ axes.T)
    enclosed = ((places >= low) & (places <= high)).all(axis=1)
    enclosed[enclosed] = winding(places[enclosed], outline) != 0
    places_ras = centre_ras + places @ axes
    inside = shown.geometry.contains(places_ras)
    k, j, i = shown.geometry.nearest_voxels(places_ras[inside]).T
    inside[inside] = shown.array[k, j, i] >= in_units_of(shown.array, shown.iso)
    return float(2.0 * (enclosed & inside).sum() / max(enclosed.sum() + inside.sum(), 1))


def _length_mm(points_ras: np.ndarray) -> float:
    farthest_mm = float(np.linalg.norm(points_ras[:, None] - points_ras, axis=-1).max())
    # What lies off the structure is so much farther apart than the structure is long.
    return farthest_mm / (1.0 + 2.0 * BEYOND)


def _places(low: np.ndarray, high: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """A grid in a plane, (N, 2), from the corners of an outline's box, and as far as a map may reach."""
    first, last = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    step = max((high - low).max() / _PLACES, float(np.sqrt(np.prod(last - first) / _MOST_PLACES)))
    along = [np.arange(start + step / 2.0, stop, step) for start, stop in zip(first, last, strict=True)]
    return np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2)


def _corners_ras(geometry: Geometry) -> np.ndarray:
    """(8, 3)."""
    sides = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return geometry.ijk_to_ras_points(sides * geometry.shape[::-1] - 0.5)
