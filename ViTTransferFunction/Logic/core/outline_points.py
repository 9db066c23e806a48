"""Points inside an outline that somebody drew around a part of a structure."""

from __future__ import annotations

import numpy as np

from .spread_points import spread_points

MOST_POINTS = 8
"""More say little that is new, and each counts as a click when a threshold is chosen."""
CLOSEST_MM = 4.0
"""Nearer points would mostly lie in one feature cell, and say the same twice."""
SHALLOWEST = 1 / 3
"""Share of the outline's inner radius that points keep from it: lines are drawn roughly, and borders belong to both sides."""

_CORNERS = 120
_CANDIDATES = 40
"""Along each edge of the outline's box: fine enough for narrow loops, and done in a few milliseconds."""


def points_within_outline(outline_ras: np.ndarray) -> np.ndarray:
    """A handful of points well inside a closed outline, spread over it.

    Args:
        outline_ras: (N, 3) RAS millimetres, in one plane; its end is joined to its beginning. Where it crosses itself, whatever
            it goes around counts as inside.

    Returns:
        (M, 3) RAS millimetres, at most `MOST_POINTS`; none where the outline encloses no area.
    """
    centre_ras, axes = _plane(outline_ras)
    outline = _evenly((outline_ras - centre_ras) @ axes.T)
    low, high = outline.min(axis=0), outline.max(axis=0)
    if (high - low).min() < 1e-6:
        return np.empty((0, 3))
    # Centres of a grid's fields.
    steps = (np.arange(_CANDIDATES) + 0.5) / _CANDIDATES
    candidates = low + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * (high - low)
    inside = candidates[_winding(candidates, outline) != 0]
    if not len(inside):
        return np.empty((0, 3))
    depth = _distance(inside, outline)
    deep = depth >= SHALLOWEST * depth.max()
    inside, depth = inside[deep], depth[deep]
    taken = inside[spread_points(inside, [int(depth.argmax())], MOST_POINTS, CLOSEST_MM)]
    points_ras: np.ndarray = centre_ras + taken @ axes
    return points_ras


def _plane(points_ras: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A point (3,) of the plane that is nearest to all points (N, 3), and two orthogonal unit vectors in it, (2, 3)."""
    centre_ras = points_ras.mean(axis=0)
    _, _, axes = np.linalg.svd(np.concatenate([points_ras - centre_ras, np.zeros((3, 3))]), full_matrices=False)
    return centre_ras, axes[:2]


def _evenly(outline: np.ndarray) -> np.ndarray:
    """The closed outline (N, 2) by corners at equal distances along it, so that slow drawing costs no more than fast."""
    closed = np.concatenate([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    places = np.linspace(0.0, along[-1], _CORNERS, endpoint=False)
    return np.stack([np.interp(places, along, closed[:, axis]) for axis in (0, 1)], axis=1)


def _winding(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """(P,) how often the closed outline (N, 2) goes around each of the points (P, 2)."""
    start, step = outline[None], np.roll(outline, -1, axis=0)[None] - outline[None]
    offset = points[:, None] - start
    left = step[..., 0] * offset[..., 1] - step[..., 1] * offset[..., 0] > 0.0
    from_below, to_above = offset[..., 1] >= 0.0, offset[..., 1] < step[..., 1]
    upward, downward = from_below & to_above & left, ~from_below & ~to_above & ~left
    winding: np.ndarray = upward.sum(axis=1) - downward.sum(axis=1)
    return winding


def _distance(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """(P,) distance of each of the points (P, 2) to the closed outline (N, 2)."""
    start, step = outline[None], np.roll(outline, -1, axis=0)[None] - outline[None]
    offset = points[:, None] - start
    share = (offset * step).sum(axis=2) / np.maximum((step**2).sum(axis=2), 1e-12)
    nearest: np.ndarray = np.linalg.norm(offset - np.clip(share, 0.0, 1.0)[..., None] * step, axis=2).min(axis=1)
    return nearest
