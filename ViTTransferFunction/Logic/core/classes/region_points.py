"""Points that a drawn region stands for: a handful inside, spread over it; of a structure's outline, also around it."""

from __future__ import annotations

import numpy as np

from ..system.errors import InputError
from ..volumes.geometry import transform_points
from .diameter_points import BEYOND, LEAST_BEYOND_MM
from .outlines import distance_to, evenly, plane_through, winding
from .spread_points import spread_points

MOST_POINTS = 8
"""More say little that is new, and each counts as a click when a threshold is chosen."""
CLOSEST_MM = 4.0
"""Nearer points would mostly lie in one feature cell of a body's scan, and say the same twice."""
SHALLOWEST = 1 / 3
"""Share of a region's inner radius that points keep from its border: it is drawn roughly, and may touch the neighbours."""

MOST_AROUND = 6
"""So many points around an outline are enough: all say the same, that the structure ends there."""

_CANDIDATES = 40
_CANDIDATES_3D = 12
"""Along each edge of a region: in the plane fine enough for narrow loops, and done in a few milliseconds."""


def points_within_outline(outline_ras: np.ndarray, scale: float) -> np.ndarray:
    """Points well inside a closed outline.

    Args:
        outline_ras: (N, 3) RAS millimetres, in one plane; its end is joined to its beginning. Where it crosses itself, whatever
            it goes around counts as inside.
        scale: of lengths that are meant for bodies (`body_scale`).

    Returns:
        (M, 3) RAS millimetres, at most `MOST_POINTS`; none where the outline encloses no area.
    """
    centre_ras, axes = plane_through(outline_ras)
    within: np.ndarray = centre_ras + _chosen(*_within(evenly((outline_ras - centre_ras) @ axes.T)), scale) @ axes
    return within


def points_of_outline(outline_ras: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Points inside a structure and around it, in the plane in which its outline was drawn, along its edge.

    Those around it are as far from it as those beyond the ends of a diameter (`points_of_diameter`) of the largest circle
    that fits in.

    Args:
        outline_ras: (N, 3), as for `points_within_outline`.
        scale: as there.

    Returns:
        (M, 3) points inside, the deepest first, 1 ≤ M ≤ `MOST_POINTS`, and (P, 3) points outside, P ≤ `MOST_AROUND`; RAS
        millimetres.

    Raises:
        InputError: the outline encloses no area.
    """
    centre_ras, axes = plane_through(outline_ras)
    outline = evenly((outline_ras - centre_ras) @ axes.T)
    inside, depth = _within(outline)
    if not len(inside):
        raise InputError("The outline encloses nothing. Drag once around the structure, along its edge, in one slice.")
    around = _around(outline, max(BEYOND * 2.0 * float(depth.max()), scale * LEAST_BEYOND_MM), scale)
    within: np.ndarray = centre_ras + _chosen(inside, depth, scale) @ axes
    outside: np.ndarray = centre_ras + around @ axes
    return within, outside


def points_within_box(box_to_ras: np.ndarray, size_mm: np.ndarray, scale: float) -> np.ndarray:
    """Points well inside a box.

    Args:
        box_to_ras: (4, 4), from millimetres along the box's orthogonal axes, with its centre at 0, to RAS millimetres.
        size_mm: (3,) lengths of its edges.
        scale: of lengths that are meant for bodies (`body_scale`).

    Returns:
        (M, 3) RAS millimetres, 1 ≤ M ≤ `MOST_POINTS`.
    """
    candidates = (_grid(_CANDIDATES_3D, 3) - 0.5) * size_mm
    depth = (0.5 * size_mm - np.abs(candidates)).min(axis=1)
    return transform_points(box_to_ras, _chosen(candidates, depth, scale))


def _within(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places inside an outline (N, 2), on a grid, (P, 2), and how deep inside each is, (P,)."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    if (high - low).min() < 1e-6:
        return np.empty((0, 2)), np.empty(0)
    places = low + _grid(_CANDIDATES, 2) * (high - low)
    inside = places[winding(places, outline) != 0]
    return inside, distance_to(inside, outline)


def _around(outline: np.ndarray, distance_mm: float, scale: float) -> np.ndarray:
    """A few places outside an outline (N, 2), all around it, at this distance, (P, 2)."""
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    across = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    places: np.ndarray = np.concatenate([outline + side * distance_mm * across for side in (1.0, -1.0)])
    # Of a hollow, what lies nearer to its other side is left out.
    places = places[(winding(places, outline) == 0) & (distance_to(places, outline) >= 0.99 * distance_mm)]
    if not len(places):
        return places
    first = int(np.linalg.norm(places - outline.mean(axis=0), axis=1).argmax())
    around: np.ndarray = places[spread_points(places, [first], MOST_AROUND, scale * CLOSEST_MM)]
    return around


def _grid(count: int, dimensions: int) -> np.ndarray:
    """Centres of the fields of a grid in [0, 1], `count` along each axis, (N, dimensions)."""
    steps = (np.arange(count) + 0.5) / count
    return np.stack(np.meshgrid(*[steps] * dimensions), axis=-1).reshape(-1, dimensions)


def _chosen(inside: np.ndarray, depth: np.ndarray, scale: float) -> np.ndarray:
    """A few of the points (N, D), which lie inside by `depth` (N,): from the deepest on, and none that is shallow."""
    if not len(inside):
        return inside
    deep = depth >= SHALLOWEST * depth.max()
    inside, depth = inside[deep], depth[deep]
    chosen: np.ndarray = inside[spread_points(inside, [int(depth.argmax())], MOST_POINTS, scale * CLOSEST_MM)]
    return chosen
