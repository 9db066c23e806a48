"""The smallest box around what is true."""

from __future__ import annotations

import numpy as np

from .geometry import Box


def bounding_box(mask: np.ndarray, margin: int = 0) -> Box | None:
    """The smallest box of all true voxels, and some more; None where no voxel is true.

    Args:
        mask: (K, J, I) bool.
        margin: voxels around, as far as the array reaches.
    """
    extents = [np.flatnonzero(mask.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    if not extents[0].size:
        return None
    k, j, i = (
        slice(max(int(extent[0]) - margin, 0), min(int(extent[-1]) + 1 + margin, size))
        for extent, size in zip(extents, mask.shape, strict=True)
    )
    return k, j, i
