"""Parts of a mask: its largest piece, and how deep its voxels lie in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box

Voxel = tuple[int, int, int]
"""Index along (K, J, I)."""


def largest_component(mask: np.ndarray) -> np.ndarray:
    """The connected component (faces touching) with the most voxels, (K, J, I) bool; the first one of equals."""
    largest = np.zeros(mask.shape, dtype=bool)
    box = bounding_box(mask)
    if box:
        components, _ = ndimage.label(mask[box])
        sizes = np.bincount(components.ravel())
        sizes[0] = 0
        largest[box] = components == sizes.argmax()
    return largest


def depth_mm(mask: np.ndarray, spacing_mm: Sequence[float]) -> np.ndarray:
    """Distance of each voxel of a mask from its outside, (K, J, I) millimetres, 0 outside; beyond the volume is outside."""
    depths = np.zeros(mask.shape)
    box = bounding_box(mask)
    if box:
        padded = np.pad(mask[box], 1)
        depths[box] = ndimage.distance_transform_edt(padded, sampling=tuple(spacing_mm))[1:-1, 1:-1, 1:-1]
    return depths


def deepest_voxel(mask: np.ndarray, spacing_mm: Sequence[float]) -> Voxel:
    """The voxel of a mask that is farthest from its outside; the first one of equals.

    Raises:
        ValueError: the mask is empty.
    """
    if not mask.any():
        raise ValueError("an empty mask has no deepest voxel")
    return voxel_at(int(depth_mm(mask, spacing_mm).argmax()), mask.shape)


def voxel_at(flat: int, shape: tuple[int, ...]) -> Voxel:
    """The voxel at an index into the flattened volume."""
    k, j, i = (int(n) for n in np.unravel_index(flat, shape))
    return k, j, i
