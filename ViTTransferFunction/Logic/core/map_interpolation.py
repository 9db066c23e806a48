"""The part of a similarity map that matters, and its values between its cells, on any finer regular grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .geometry import Box


def in_units_of(array: np.ndarray, similarity: float) -> float:
    """A similarity in [0, 1] as `array` expresses it: as it is, or with 255 for 1 if that is uint8."""
    return 255.0 * similarity if array.dtype == np.uint8 else similarity


def box_above(array: np.ndarray, similarity: float, margin: int) -> Box | None:
    """The smallest box of a map that holds all voxels of at least `similarity`, and some more; None if there are none.

    Args:
        array: (K, J, I) float32 in [0, 1], or uint8 with 255 for 1.
        similarity: in [0, 1].
        margin: voxels around, within the map.
    """
    above = array >= in_units_of(array, similarity)
    extents = [np.flatnonzero(above.any(axis=axes)) for axes in ((1, 2), (0, 2), (0, 1))]
    if not extents[0].size:
        return None
    k, j, i = (
        slice(max(int(extent[0]) - margin, 0), min(int(extent[-1]) + 1 + margin, size))
        for extent, size in zip(extents, array.shape, strict=True)
    )
    return k, j, i


def interpolated(array: np.ndarray, positions: Sequence[np.ndarray], cubic: bool = False) -> np.ndarray:
    """`array` at all combinations of positions along its axes.

    Args:
        array: (K, J, I), any real dtype.
        positions: for each axis, in voxels, integers at voxel centres; beyond the array's border its values are those there.
        cubic: smoothly, by Mitchell and Netravali's filter: almost as smooth as a B-spline, almost as sharp as an
            interpolating one. Else trilinearly.

    Returns:
        Float32, as many along each axis as there are positions.
    """
    k, j, i = (_weights(position, count, cubic) for position, count in zip(positions, array.shape, strict=True))
    # In an order in which nothing has to be transposed.
    fine = j @ (array.astype(np.float32, copy=False) @ i.T)
    return (k @ fine.reshape(len(fine), -1)).reshape(len(k), len(j), len(i))


def cell_positions(cells: int, voxels: int, extent: slice | None = None) -> np.ndarray:
    """Where the centres of voxels lie, in cells, if `voxels` of them fill the same box as `cells` cells.

    Args:
        cells: along an axis.
        voxels: along the same axis.
        extent: which of the voxels, if not all.
    """
    extent = extent or slice(0, voxels)
    return (np.arange(extent.start, extent.stop) + 0.5) * (cells / voxels) - 0.5


def _weights(position: np.ndarray, count: int, cubic: bool) -> np.ndarray:
    """(len(position), count): how much each of `count` cells contributes at each position; rows sum to 1."""
    weights = np.zeros((len(position), count), dtype=np.float32)
    lower = np.floor(position).astype(int)
    rows = np.arange(len(position))
    for offset in range(-1, 3) if cubic else range(2):
        distance = np.abs(position - lower - offset)
        share = _mitchell_netravali(distance) if cubic else 1.0 - distance
        np.add.at(weights, (rows, np.clip(lower + offset, 0, count - 1)), share)
    return weights


def _mitchell_netravali(distance: np.ndarray) -> np.ndarray:
    """The cubic filter of Mitchell & Netravali 1988 with B = C = 1/3, at distances below 2 cells."""
    near = (7.0 * distance**3 - 12.0 * distance**2 + 16.0 / 3.0) / 6.0
    far = (-7.0 / 3.0 * distance**3 + 12.0 * distance**2 - 20.0 * distance + 32.0 / 3.0) / 6.0
    return np.where(distance < 1.0, near, far)
