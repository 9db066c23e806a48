"""Depths and intensities smoothed a little, so that normals do not show the voxels."""

from __future__ import annotations

import numpy as np


def smoothed(values: np.ndarray, passes: int) -> np.ndarray:
    """uint8 values (k, j, i) smoothed as in `binomial`, 0 beyond them; as many, and uint8 again."""
    unit = 4**passes
    even: np.ndarray = ((binomial(np.pad(values, passes), passes) + unit // 2) // unit).astype(np.uint8)
    return even


def binomial(values: np.ndarray, passes: int) -> np.ndarray:
    """uint8 values smoothed `passes` (0 to 2) times by [1 2 1] along each axis, which shortens it by 2.

    Returns:
        uint16, times 4 to the power of `passes`.
    """
    smooth = values.astype(np.uint16)
    for axis in range(3):
        for _ in range(2 * passes):
            along = np.moveaxis(smooth, axis, 0)
            smooth = np.moveaxis(along[:-1] + along[1:], 0, axis)
        if axis < 2:
            smooth >>= np.uint16(2 * passes)
    return smooth
