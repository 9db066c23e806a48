"""Closed outlines in a plane: where the plane lies, what they go around, and how far it is to them."""

from __future__ import annotations

import numpy as np

_CORNERS = 120


def plane_through(points_ras: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A point (3,) of the plane that is nearest to all points (N, 3), and two orthogonal unit vectors in it, (2, 3)."""
    centre_ras = points_ras.mean(axis=0)
    _, _, axes = np.linalg.svd(np.concatenate([points_ras - centre_ras, np.zeros((3, 3))]), full_matrices=False)
    return centre_ras, axes[:2]


def evenly(outline: np.ndarray) -> np.ndarray:
    """The closed outline (N, 2) by corners at equal distances along it, so that slow drawing costs no more than fast."""
    closed = np.concatenate([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    places = np.linspace(0.0, along[-1], _CORNERS, endpoint=False)
    return np.stack([np.interp(places, along, closed[:, axis]) for axis in (0, 1)], axis=1)


def winding(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """(P,) how often the closed outline (N, 2) goes around each of the points (P, 2)."""
    start, step = outline[None], np.roll(outline, -1, axis=0)[None] - outline[None]
    offset = points[:, None] - start
    left = step[..., 0] * offset[..., 1] - step[..., 1] * offset[..., 0] > 0.0
    from_below, to_above = offset[..., 1] >= 0.0, offset[..., 1] < step[..., 1]
    upward, downward = from_below & to_above & left, ~from_below & ~to_above & ~left
    around: np.ndarray = upward.sum(axis=1) - downward.sum(axis=1)
    return around


def distance_to(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """(P,) distance of each of the points (P, 2) to the closed outline (N, 2)."""
    start, step = outline[None], np.roll(outline, -1, axis=0)[None] - outline[None]
    offset = points[:, None] - start
    share = (offset * step).sum(axis=2) / np.maximum((step**2).sum(axis=2), 1e-12)
    nearest: np.ndarray = np.linalg.norm(offset - np.clip(share, 0.0, 1.0)[..., None] * step, axis=2).min(axis=1)
    return nearest
