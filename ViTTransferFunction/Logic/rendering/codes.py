"""The code of each voxel of a class, from which a renderer takes opacity (`optical_properties`) and normals.

    code   0 …………… SURFACE ……… SURFACE + (255 - SURFACE) × height ……… SURFACE
    where  a ramp outside   on the surface     a little below it     deep inside

The outer ramp is transparent: it carries normals, and colours to interpolate with. Opacity gathers in a thin layer inside the
surface. A class's opacity sets the height of its ramp. Those of opaque classes are so high that all light is gone half-way up,
where normals are at their best; those of translucent ones fall off again, so that what they enclose is seen.
"""

from __future__ import annotations

import numpy as np

from .optical_properties import DEEPEST, LAYER_VOXELS, SURFACE

OPAQUE_RAMP = (0.02, 0.5, 0.93, 1.0)
TRANSLUCENT_RAMP = (0.02, 0.5, 0.8, 0.97)
"""Memberships, of 1, where the code's ramp starts, crosses the surface, is highest, and has fallen off again, if it does."""

TRANSLUCENT_LAYER_VOXELS = 3.0
"""Thickness of a translucent class's layer, up and down: thinner, and it varies with how voxels happen to cut it."""


def class_codes(
    values: np.ndarray, opacity: float, passes: int, opaque_ramp: tuple[float, float, float, float] = OPAQUE_RAMP
) -> np.ndarray:
    """The codes (k, j, i) uint8 of a class for its memberships, which are smoothed so that normals do not show the voxels."""
    highest, lowest, ramp = 255.0, 255.0, opaque_ramp
    if opacity < 1.0:
        values = (binomial(np.pad(values, 2), passes=2) >> np.uint16(4)).astype(np.uint8)
        depth = min(-np.log1p(-opacity), DEEPEST)
        height = np.sqrt(depth / DEEPEST * LAYER_VOXELS / TRANSLUCENT_LAYER_VOXELS)
        highest, lowest, ramp = SURFACE + (255 - SURFACE) * height, SURFACE, TRANSLUCENT_RAMP
    smooth = binomial(np.pad(values, passes), passes)
    codes = np.interp(np.linspace(0.0, 1.0, 255 * 4**passes + 1), ramp, [0, SURFACE, highest, lowest])
    of_class: np.ndarray = np.rint(codes).astype(np.uint8)[smooth]
    return of_class


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
