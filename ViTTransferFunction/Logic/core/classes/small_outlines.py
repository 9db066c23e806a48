"""Decides whether a structure that begins with an outline gets a close-up: if this is small, and the map disagrees with it.

The outline is the truth in one slice. If the whole volume's map agrees with it there, a close-up does not improve the
structure, and often makes it worse, however small it is; if it disagrees, most structures improve.
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
"""A diameter or an outline is small if it is shorter than this many cells; see `Benchmarks/results/candidates.md`, from
*A diameter instead of the first click* on."""
LEAST_AGREEMENT = 0.8
"""Below this Dice in the outline's slice, the map disagrees with the outline. Chosen on AMOS 336 and the brain, see
`Benchmarks/results/candidates.md`, *Looked at closely without being asked*."""

REACH = 0.5
"""Limit of the structure's extent beyond its points when its box is chosen, as a share of the outline's length: the map is
wrong, and often floods the surroundings. A smaller box has smaller cells, and less of the surroundings. Chosen on AMOS 336."""

_PLACES = 32
"""Number of sample places along an outline's box, for the comparison with the map."""
_MOST_PLACES = 250_000
"""Largest total number of sample places, for maps that are much larger than the outline; these take a tenth of a second."""


def unasked_close_up(
    shown: ClassMap, outline_ras: np.ndarray, points_ras: np.ndarray, geometry: Geometry, cell_mm: float
) -> CloseUp | None:
    """The close-up that a structure gets at once; None: it stays in the whole volume.

    Args:
        shown: as for `asks_for_close_up`.
        outline_ras: as for `asks_for_close_up`.
        points_ras: the structure's positive points (N, 3), N ≥ 1, RAS millimetres.
        geometry: grid of the volume.
        cell_mm: as for `asks_for_close_up`.
    """
    scale = geometry.body_scale
    if not asks_for_close_up(shown, outline_ras, cell_mm, scale):
        return None
    try:
        return close_up_of(shown, points_ras, geometry, reach_mm(outline_ras, scale))
    except InputError:
        return None  # The box would be too large a part of the volume.


def asks_for_close_up(shown: ClassMap, outline_ras: np.ndarray, cell_mm: float, scale: float) -> bool:
    """Whether a structure is to get a close-up at once.

    Args:
        shown: the structure's refined map in the whole volume, since cells are too large for a comparison with small outlines.
        outline_ras: (N, 3) RAS millimetres in the frame of the map, as for `points_of_outline`, which it begins with.
        cell_mm: the longest edge of the whole volume's cells.
        scale: as for `points_of_outline`.
    """
    points = np.concatenate(points_of_outline(outline_ras, scale))
    return is_small(points, cell_mm) and agreement(shown, outline_ras) < LEAST_AGREEMENT


def is_small(points_ras: np.ndarray, cell_mm: float) -> bool:
    """Whether a diameter or an outline, given by the points (N, 3) that replace it, RAS millimetres, is small for the cells."""
    return _length_mm(points_ras) < SMALL_CELLS * cell_mm


def reach_mm(outline_ras: np.ndarray, scale: float) -> float:
    """The `reach_mm` of `close_up_of` for a structure that begins with an outline (N, 3) with which the map disagrees."""
    return REACH * _length_mm(np.concatenate(points_of_outline(outline_ras, scale)))


def agreement(shown: ClassMap, outline_ras: np.ndarray) -> float:
    """Dice of a structure's map and the area within an outline, in the outline's whole plane.

    Args:
        shown: the map, whose values from the iso value on are in the segment (`SegmentCrops`); nothing beyond its grid is.
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
    # Points outside lie beyond both ends of the structure, by this share of its length.
    return farthest_mm / (1.0 + 2.0 * BEYOND)


def _places(low: np.ndarray, high: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Sample places in a plane, (N, 2): a regular grid over an outline's box and the projected `corners` of a map."""
    first, last = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    step = max((high - low).max() / _PLACES, float(np.sqrt(np.prod(last - first) / _MOST_PLACES)))
    along = [np.arange(start + step / 2.0, stop, step) for start, stop in zip(first, last, strict=True)]
    return np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2)


def _corners_ras(geometry: Geometry) -> np.ndarray:
    """Corners of a grid's box, (8, 3) RAS millimetres."""
    sides = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return geometry.ijk_to_ras_points(sides * geometry.shape[::-1] - 0.5)
