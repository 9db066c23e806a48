"""Interpolates values of a grid between its points, and on other grids: maps, feature vectors, labels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import reduce

import numpy as np
from scipy import ndimage

from .geometry import Box, Geometry


def sample_at(values: np.ndarray, geometry: Geometry, points_ras: np.ndarray) -> np.ndarray:
    """Trilinear samples of a grid of vectors at world points, constant beyond the outermost centres.

    Args:
        values: (K, J, I, C).
        geometry: of the grid.
        points_ras: (N, 3) RAS millimetres.

    Returns:
        (N, C) float32.
    """
    return sample_by(lambda index: values[tuple(index.T)], geometry, points_ras)


def sample_by(vectors_at: Callable[[np.ndarray], np.ndarray], geometry: Geometry, points_ras: np.ndarray) -> np.ndarray:
    """As `sample_at`, with a function that returns the vectors (N, C) at indices (N, 3) along K, J, I."""
    corners = corners_around(geometry, points_ras)
    samples: np.ndarray = reduce(np.add, (weight[:, None] * vectors_at(index) for index, weight in corners))
    return samples.astype(np.float32)


def corners_around(geometry: Geometry, points_ras: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yields, for each of the eight voxels around world points (N, 3), its indices (N, 3) along K, J, I and weights (N,).

    The eight weights of a point sum to 1. Points beyond the outermost voxel centres are moved to them.
    """
    kji = geometry.ras_to_ijk(points_ras)[:, ::-1]
    last = np.array(geometry.shape) - 1
    kji = np.clip(kji, 0, last)
    base = np.floor(kji).astype(int)
    fraction = kji - base
    for corner in np.ndindex(2, 2, 2):
        yield np.minimum(base + corner, last), np.prod(np.where(corner, fraction, 1.0 - fraction), axis=1)


class FixedPlaces:
    """Samples many maps of a grid at the same points, which need their voxels and weights computed only once.

    Args:
        geometry: geometry of the grid.
        points_ras: (N, 3) RAS millimetres.
    """

    def __init__(self, geometry: Geometry, points_ras: np.ndarray) -> None:
        corners = list(corners_around(geometry, points_ras))
        # Along each axis, the voxels before and after each point: (2, 3, N).
        self._ends = np.ascontiguousarray(np.stack([corners[0][0].T, corners[-1][0].T]))
        self._weights = [weight for _, weight in corners]

    def sample(self, values: np.ndarray, box: Box, elsewhere: np.ndarray) -> np.ndarray:
        """Trilinear samples of a map of which only a part is given.

        Args:
            values: the map's values in the box, (K, J, I).
            box: the part of the grid.
            elsewhere: (N,) samples to use for points that need voxels outside the box.

        Returns:
            (N,) float32; for all other points, the samples of `sample_at`.
        """
        samples = elsewhere.astype(np.float32)
        first, end = np.array([(extent.start, extent.stop) for extent in box]).T[:, :, None]
        inside = np.flatnonzero(((self._ends >= first) & (self._ends < end)).all(axis=(0, 1)))
        if len(inside):
            strides = np.array([values.shape[1] * values.shape[2], values.shape[2], 1])[:, None]
            along = (self._ends[:, :, inside] - first) * strides
            flat = values.ravel()
            parts = [
                weight[inside] * flat[along[k, 0] + along[j, 1] + along[i, 2]]
                for (k, j, i), weight in zip(np.ndindex(2, 2, 2), self._weights, strict=True)
            ]
            samples[inside] = np.sum(parts, axis=0)
        return samples


def interpolated(array: np.ndarray, positions: Sequence[np.ndarray], cubic: bool = False) -> np.ndarray:
    """`array` at all combinations of positions along its axes.

    Args:
        array: (K, J, I), any real dtype.
        positions: for each axis, positions in voxels, integers at voxel centres; beyond the border, values are constant.
        cubic: whether to use Mitchell and Netravali's cubic filter, which is almost as smooth as a B-spline and almost as sharp
            as an interpolating one, instead of trilinear interpolation. Its values may lie outside the array's range.

    Returns:
        Float32, of as many values along each axis as there are positions.
    """
    k, j, i = (_weights(position, count, cubic) for position, count in zip(positions, array.shape, strict=True))
    # In this order, nothing has to be transposed.
    fine: np.ndarray = j @ (array.astype(np.float32, copy=False) @ i.T)
    if not np.array_equal(k, np.eye(len(fine))):
        fine = (k @ fine.reshape(len(fine), -1)).reshape(len(k), len(j), len(i))
    return fine


def planes_between(planes: np.ndarray, places: Iterable[tuple[int, float]]) -> Iterator[np.ndarray]:
    """Planes between those of an array, one by one, because writing all to memory would take longer than computing them.

    Args:
        planes: (K, J, I) float32.
        places: for each wanted plane, the index of the plane before it, and its distance from that in planes, from 0 to 1.
            Beyond the last plane, that one is repeated.

    Yields:
        (J, I) float32; each plane overwrites the one before.
    """
    between = np.empty_like(planes[0])
    for low, share in places:
        np.subtract(planes[min(low + 1, len(planes) - 1)], planes[low], out=between)
        between *= np.float32(share)
        between += planes[low]
        yield between


def cell_positions(cells: int, voxels: int, extent: slice | None = None) -> np.ndarray:
    """Positions of voxel centres in units of cells, if voxels and cells fill the same box.

    Args:
        cells: number of cells along an axis.
        voxels: number of voxels along the same axis.
        extent: range of the voxels; None: all of them.

    Returns:
        One position for each voxel, float64, integers at cell centres.
    """
    extent = extent or slice(0, voxels)
    return (np.arange(extent.start, extent.stop) + 0.5) * (cells / voxels) - 0.5


def resample_labels(labels: np.ndarray, geometry: Geometry, target: Geometry) -> np.ndarray:
    """The label at each voxel centre of another grid; 0 outside, since Slicer stores only the box that segments fill.

    Args:
        labels: (K, J, I) on `geometry`, integers or bool.
        geometry: geometry of the labels.
        target: the other grid.

    Returns:
        (K, J, I) of `target`, the dtype of `labels`.
    """
    # Rounded, so that grids that coincide except for rounding errors are recognised.
    source_of_target = np.round(np.linalg.inv(geometry.ijk_to_ras) @ target.ijk_to_ras, 6)
    matrix, offset = source_of_target[2::-1, 2::-1], source_of_target[2::-1, 3]
    if np.array_equal(matrix, np.eye(3)) and np.array_equal(offset, np.round(offset)):
        # The usual case, in which copying is many times faster.
        return _shifted_copy(labels, offset.astype(int).tolist(), target.shape)
    if np.count_nonzero(matrix) == 3:
        return _along_axes(labels, matrix, offset, target.shape)
    integers = labels.view(np.uint8) if labels.dtype == bool else labels
    # With the mode "constant", the outer half of border voxels would count as outside.
    resampled = ndimage.affine_transform(
        integers, matrix, offset, output_shape=target.shape, order=0, mode="grid-constant", prefilter=False
    )
    nearest: np.ndarray = resampled.view(labels.dtype)
    return nearest


def _along_axes(labels: np.ndarray, matrix: np.ndarray, offset: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Labels on a grid with parallel axes, in any order and direction: each axis is resampled by its own indices."""
    target_axes = np.argmax(matrix != 0.0, axis=1)
    turned = labels.transpose(np.argsort(target_axes))
    copy = np.zeros(shape, dtype=labels.dtype)
    targets, sources = [], []
    for axis, (count, size) in enumerate(zip(turned.shape, shape, strict=True)):
        (source_axis,) = np.flatnonzero(target_axes == axis)
        source = np.floor(matrix[source_axis, axis] * np.arange(size) + offset[source_axis] + 0.5).astype(int)
        inside = np.flatnonzero((source >= 0) & (source < count))
        targets.append(slice(int(inside[0]), int(inside[-1]) + 1) if len(inside) else slice(0, 0))
        sources.append(source[inside])
    copy[tuple(targets)] = turned[np.ix_(*sources)]
    return copy


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


def _shifted_copy(labels: np.ndarray, first: Sequence[int], shape: tuple[int, int, int]) -> np.ndarray:
    """A copy of `shape` that begins at voxel `first` (k, j, i) of `labels`; 0 where it lies outside of them."""
    copy = np.zeros(shape, dtype=labels.dtype)
    target = tuple(slice(max(-start, 0), max(size - start, 0)) for start, size in zip(first, labels.shape, strict=True))
    source = tuple(slice(max(start, 0), max(start + size, 0)) for start, size in zip(first, shape, strict=True))
    copy[target] = labels[source]
    return copy
