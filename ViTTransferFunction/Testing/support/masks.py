"""Masks of simple shapes, and how well two masks agree."""

from __future__ import annotations

import numpy as np


def box_mask(shape: tuple[int, int, int], k: slice, j: slice, i: slice) -> np.ndarray:
    """A mask (K, J, I) of the voxels within a box."""
    mask = np.zeros(shape, dtype=bool)
    mask[k, j, i] = True
    return mask


def dice(a: np.ndarray, b: np.ndarray) -> float:
    """How well two masks agree, 0 to 1."""
    return 2.0 * float((a & b).sum()) / float(a.sum() + b.sum())
