"""The canonical orientation: slices as a person looks at them, in whatever order and direction a file stores its voxels.

The network was trained on upright pictures, and its features of a mirrored or rotated slice are different. Without this, the
same scan stored in another order would give other features.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from .geometry import Geometry

CANONICAL_DIRECTIONS_RAS = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Directions of the canonical array's axes: inferior, posterior and the patient's left. So axial slices have anterior on top,
coronal and sagittal ones superior; and the patient's right is on the left, in sagittal slices anterior."""


@dataclass(frozen=True)
class Orientation:
    """A permutation and mirroring of array axes.

    Attributes:
        order: the stored axes that become canonical axes 0, 1 and 2.
        mirrored: for each canonical axis, whether its direction is opposite to that of the stored one.
    """

    order: tuple[int, int, int]
    mirrored: tuple[bool, bool, bool]

    def to_canonical(self, array: np.ndarray) -> np.ndarray:
        """A view of (K, J, I), or (K, J, I, C), with canonical axes."""
        return np.flip(array.transpose(*self.order, *range(3, array.ndim)), self._mirrored_axes)

    def spread(self, array: np.ndarray, most: int) -> np.ndarray:
        """A view of `most` voxels or fewer of (K, J, I), or (K, J, I, C), with canonical axes.

        They are regularly spaced along each axis, and the same in whatever order a scan is stored. Every n-th voxel of the
        flattened array would depend on that order, and come from a few columns only if the length of rows is a multiple of n.
        """
        canonical, steps = self.to_canonical(array), [1, 1, 1]
        while math.prod(left := [-(-size // step) for size, step in zip(canonical.shape[:3], steps, strict=True)]) > most:
            steps[int(np.argmax(left))] += 1
        return canonical[tuple(slice(step // 2, None, step) for step in steps)]

    @property
    def _mirrored_axes(self) -> tuple[int, ...]:
        return tuple(axis for axis in range(3) if self.mirrored[axis])

    @property
    def runs_along(self) -> tuple[bool, bool, bool]:
        """Whether each stored axis has the direction of its canonical one; see `voxels_before`."""
        first, second, third = (not self.mirrored[self.order.index(axis)] for axis in range(3))
        return first, second, third

    def canonical_shape(self, shape: tuple[int, int, int]) -> tuple[int, int, int]:
        """The shape of an array of `shape` after `to_canonical`."""
        return shape[self.order[0]], shape[self.order[1]], shape[self.order[2]]


AS_STORED = Orientation((0, 1, 2), (False, False, False))


def canonical_orientation(geometry: Geometry) -> Orientation:
    """The orientation whose axes lie closest to the canonical ones; oblique volumes are not resampled."""
    directions = (geometry.ijk_to_ras[:3, :3] / geometry.spacing_mm).T[::-1]  # Of array axes K, J, I.
    alignment = CANONICAL_DIRECTIONS_RAS @ directions.T
    order = max(permutations(range(3)), key=lambda axes: sum(abs(alignment[row, axis]) for row, axis in enumerate(axes)))
    first, second, third = (bool(alignment[row, axis] < 0.0) for row, axis in enumerate(order))
    return Orientation((order[0], order[1], order[2]), (first, second, third))


def voxels_before(
    shape: tuple[int, int, int],
    edges: tuple[int, int, int],
    from_end: tuple[bool, bool, bool],
    first: tuple[int, int, int] = (0, 0, 0),
) -> tuple[int, int, int]:
    """Number of voxels by which the first block of a divided volume, or of a part of it, begins before the first voxel.

    With `Orientation.runs_along` as `from_end`, blocks begin at the same end of the patient in whatever direction a scan is
    stored, and contain the same voxels.

    Args:
        shape: shape of the volume, (K, J, I).
        edges: edges of a block along (K, J, I), voxels.
        from_end: for each axis, whether the last block ends with the volume's last voxel; otherwise the first block begins with
            its first voxel.
        first: indices (K, J, I) of the part's first voxel; by default, that of the whole volume.

    Returns:
        Number of voxels of the first block before `first`, along (K, J, I).
    """
    k, j, i = ((start - size * end) % edge for start, size, end, edge in zip(first, shape, from_end, edges, strict=True))
    return k, j, i
