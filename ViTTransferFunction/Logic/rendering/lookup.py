"""Tables of values for whole volumes of indices."""

from __future__ import annotations

import numpy as np

from ..core.volumes.bounding_box import whole_box
from ..core.volumes.stepped_work import slabs

PART_VOXELS = 1 << 16
"""Indices that are looked up at a time. NumPy makes 8 bytes of each first, and these are to stay in the processor's cache."""


def looked_up(table: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """`table[indices]`, in a third of the time.

    Args:
        table: (N,), of any dtype.
        indices: (K, J, I), of an unsigned dtype, below N.

    Returns:
        (K, J, I), of the table's dtype.
    """
    found = np.empty(indices.shape, dtype=table.dtype)
    for part in slabs(whole_box(indices.shape), PART_VOXELS):
        # Unlike the others, this mode needs no copy of what it writes; indices are as they should be.
        np.take(table, indices[part], mode="clip", out=found[part])
    return found
