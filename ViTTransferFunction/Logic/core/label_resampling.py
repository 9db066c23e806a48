"""Labels and masks on another grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from .geometry import Geometry


def resample_labels(labels: np.ndarray, geometry: Geometry, target: Geometry) -> np.ndarray:
    """What each voxel centre of another grid lies in, 0 outside; Slicer stores only the box that segments fill.

    Args:
        labels: (K, J, I) on `geometry`, integers or bool.
        target: the grid to bring them to.

    Returns:
        (K, J, I) of `target`, the dtype of `labels`.
    """
    # Rounded, so that grids which coincide but for rounding errors do coincide.
    source_of_target = np.round(np.linalg.inv(geometry.ijk_to_ras) @ target.ijk_to_ras, 6)
    matrix, offset = source_of_target[2::-1, 2::-1], source_of_target[2::-1, 3]
    if np.array_equal(matrix, np.eye(3)) and np.array_equal(offset, np.round(offset)):
        # Nearly always so, and many times faster.
        return _shifted_copy(labels, offset.astype(int).tolist(), target.shape)
    integers = labels.view(np.uint8) if labels.dtype == bool else labels
    # With the mode "constant", the outer half of border voxels would be outside.
    resampled = ndimage.affine_transform(
        integers, matrix, offset, output_shape=target.shape, order=0, mode="grid-constant", prefilter=False
    )
    return resampled.view(labels.dtype)


def _shifted_copy(labels: np.ndarray, first: Sequence[int], shape: tuple[int, int, int]) -> np.ndarray:
    """The part of `labels` that starts at its voxel `first` (k, j, i), which may be outside of it as may be others."""
    copy = np.zeros(shape, dtype=labels.dtype)
    target = tuple(slice(max(-start, 0), max(size - start, 0)) for start, size in zip(first, labels.shape, strict=True))
    source = tuple(slice(max(start, 0), max(start + size, 0)) for start, size in zip(first, shape, strict=True))
    copy[target] = labels[source]
    return copy
