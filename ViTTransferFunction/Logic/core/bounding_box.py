"""The part of a grid that holds something."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .geometry import Box


def bounding_box(mask: np.ndarray, margin: int | Sequence[int] = 0) -> Box | None:
    """The smallest box that holds all true voxels of a mask, and so many voxels around them as far as there are any.

    Args:
        mask: (K, J, I) bool.
        margin: voxels on every side, at least 0; or so many along K, J and I.

    Returns:
        The box, or None where no voxel is true.
    """
    # The projection along K tells of both other axes, so that the mask itself is read twice, and not once for each axis.
    projection = np.any(mask, axis=0)
    occupied = np.any(mask, axis=(1, 2)), np.any(projection, axis=1), np.any(projection, axis=0)
    margins = (margin,) * 3 if isinstance(margin, int) else margin
    k, j, i = (_extent(along, further) for along, further in zip(occupied, margins, strict=True))
    return None if k is None or j is None or i is None else (k, j, i)


def common_box(boxes: Sequence[Box]) -> Box:
    """The smallest box that holds all of `boxes`, of which there is at least one."""
    k, j, i = (slice(min(e.start for e in extents), max(e.stop for e in extents)) for extents in zip(*boxes, strict=True))
    return k, j, i


def _extent(occupied: np.ndarray, margin: int) -> slice | None:
    """From the first true element (N,) to the last, and `margin` more on either side; None where there is none."""
    indices = np.flatnonzero(occupied)
    if not indices.size:
        return None
    return slice(max(int(indices[0]) - margin, 0), min(int(indices[-1]) + 1 + margin, len(occupied)))
