"""The part of a grid that holds something."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .geometry import Box


def bounding_box(mask: np.ndarray, margin: int | Sequence[int] = 0) -> Box | None:
    """The smallest box that holds all true voxels of a mask, and `margin` voxels on every side as far as the grid reaches.

    Args:
        mask: (K, J, I) bool.
        margin: voxels, at least 0; one number, or one each for K, J and I.

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


def whole_box(shape: tuple[int, ...]) -> Box:
    """The box of all voxels of a volume of `shape` (K, J, I)."""
    k, j, i = (slice(0, count) for count in shape)
    return k, j, i


def common_part(a: Box, b: Box) -> Box | None:
    """The box of what lies in both boxes; None where nothing does."""
    k, j, i = (slice(max(x.start, y.start), min(x.stop, y.stop)) for x, y in zip(a, b, strict=True))
    return (k, j, i) if all(extent.start < extent.stop for extent in (k, j, i)) else None


def within(box: Box, outer: Box) -> Box:
    """A box as a part of another that holds it."""
    k, j, i = (slice(e.start - o.start, e.stop - o.start) for e, o in zip(box, outer, strict=True))
    return k, j, i


def out_of(part: Box, outer: Box) -> Box:
    """A part of a box as a box of the grid that the box is of; the reverse of `within`."""
    k, j, i = (slice(e.start + o.start, e.stop + o.start) for e, o in zip(part, outer, strict=True))
    return k, j, i


def grown(box: Box, margin: Sequence[int], outer: Box) -> Box:
    """A box with `margin` voxels more on every side, along K, J and I, as far as `outer` reaches."""
    k, j, i = (
        slice(max(e.start - more, o.start), min(e.stop + more, o.stop)) for e, more, o in zip(box, margin, outer, strict=True)
    )
    return k, j, i


def covering_box(box: Box, shape: Sequence[int], other_shape: Sequence[int]) -> Box:
    """The smallest box of another grid over the same space that covers a box of a grid.

    Args:
        box: of the grid with `shape` (K, J, I).
        shape: of that grid.
        other_shape: of the grid whose box is asked for.
    """
    k, j, i = (
        slice(math.floor(extent.start * (others / count)), min(math.ceil(extent.stop * (others / count)), others))
        for extent, count, others in zip(box, shape, other_shape, strict=True)
    )
    return k, j, i


def _extent(occupied: np.ndarray, margin: int) -> slice | None:
    """From the first true element (N,) to the last, and `margin` more on either side; None where there is none."""
    indices = np.flatnonzero(occupied)
    if not indices.size:
        return None
    return slice(max(int(indices[0]) - margin, 0), min(int(indices[-1]) + 1 + margin, len(occupied)))
