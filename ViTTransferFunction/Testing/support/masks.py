"""Masks of simple shapes, and how well two masks agree."""

from __future__ import annotations

import numpy as np


def box_mask(shape: tuple[int, int, int], k: slice, j: slice, i: slice) -> np.ndarray:
    """A mask (K, J, I) of the voxels within a box."""
    mask = np.zeros(shape, dtype=bool)
    mask[k, j, i] = True
    return mask


def ball_mask(edge: int, radius: float) -> np.ndarray:
    """A ball in the middle of a cube of so many voxels along each edge, (edge, edge, edge) bool; its radius in voxels."""
    axis = np.arange(edge) - (edge - 1) / 2
    inside: np.ndarray = (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2) < radius**2
    return inside


def dice(a: np.ndarray, b: np.ndarray) -> float:
    """How well two masks agree, 0 to 1."""
    return 2.0 * float((a & b).sum()) / float(a.sum() + b.sum())
