"""How surely each voxel belongs to each class, from similarity maps of any resolution: where 3D renderings start from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..core.bounding_box import covering_box
from ..core.class_map import NEAR_SHARE_OF_ISO, box_above
from ..core.geometry import Box
from ..core.resampling import cell_positions, interpolated

Shape = tuple[int, int, int]

UNIT = 4096
"""A ratio of 1 between a map and its iso value, as an integer."""


class Membership(NamedTuple):
    """How surely the voxels around a class belong to it.

    Attributes:
        box: which part of the volume this is; voxels outside do not belong to the class.
        values: (k, j, i) uint8: 0 outside, between 127 and 128 on the surface, 255 inside.
    """

    box: Box
    values: np.ndarray


def memberships(
    maps: Sequence[np.ndarray],
    isos: Sequence[float],
    shape: Shape,
    softness_voxels: Sequence[float],
    cell_sizes: Sequence[float] = (1.0, 1.0, 1.0),
) -> Iterator[tuple[int, Membership]]:
    """The index of each class and its membership, one after the other; not of those whose map is nowhere near its iso value.

    The surface of a class is where its map reaches its iso value, or, where classes overlap, where another class's map exceeds
    its own iso value by as large a factor: as in `session.labels.assign_labels`.

    Args:
        maps: (K, J, I) each, float32 in [0, 1] or uint8 with 255 for 1; of the same box, but possibly of different shapes.
        isos: for each map, the value at its surface, in [0, 1].
        shape: (K', J', I') of the volume that memberships are for, of the same box.
        softness_voxels: for each class half the distance over which its membership rises from 0 to 255, in voxels of that
            volume. It is less where the map is too low or too steep.
        cell_sizes: along K, J, I, of the finest map, in any unit; where its cells are not cubes, and maps' slopes therefore not
            alike along all axes.
    """
    grid = finest_shape(maps)
    if math.prod(grid) > math.prod(shape):
        grid = shape
    voxel_size = min(size * cells / voxels for size, cells, voxels in zip(cell_sizes, grid, shape, strict=True))
    largest, second = np.zeros(grid, dtype=np.uint16), np.zeros(grid, dtype=np.uint16)
    near: dict[int, tuple[Box, np.ndarray]] = {}
    for index, iso in enumerate(isos):
        similarity = _on_grid(maps[index], grid)
        box = box_above(similarity, NEAR_SHARE_OF_ISO * iso, margin=2)
        if box is not None:
            ratios = _ratios(similarity[box], iso)
            np.maximum(second[box], np.minimum(largest[box], ratios), out=second[box])
            np.maximum(largest[box], ratios, out=largest[box])
            near[index] = box, ratios
    for index, (box, ratios) in near.items():
        others = np.where(ratios == largest[box], second[box], largest[box])
        # What others are above their iso values counts against the class.
        ratios -= np.minimum(ratios, np.maximum(others, UNIT) - UNIT)
        rise = _rise(ratios, softness_voxels[index] * voxel_size, cell_sizes)
        if grid != shape:
            box, ratios = _refined(ratios, box, grid, shape)
        yield index, Membership(box, rise[ratios])


def finest_shape(maps: Sequence[np.ndarray]) -> Shape:
    """The shape of the map with the most cells."""
    return max((similarity.shape for similarity in maps), key=np.prod)


def nearest_voxels(array: np.ndarray, shape: Shape) -> np.ndarray:
    """`array` at a coarser `shape` of the same box: of each voxel the value nearest to its centre."""
    for axis, count in enumerate(shape):
        size = array.shape[axis]
        if count != size:
            array = array.take(((np.arange(count) + 0.5) * size / count).astype(int), axis=axis)
    return array


def on_whole_grid(similarity: np.ndarray, box: Box, whole: Shape, shape: Shape) -> np.ndarray:
    """A map (k, j, i) of a box of the volume, 0 elsewhere, on a grid of `shape`, not finer, that fills all of the volume.

    Args:
        similarity: one value for each voxel of the box.
        box: of the volume's voxels.
        whole: the volume's shape.
        shape: (K', J', I') of the result.
    """
    result = np.zeros(shape, dtype=similarity.dtype)
    taken, places = [], []
    for extent, size, count in zip(box, whole, shape, strict=True):
        nearest = ((np.arange(count) + 0.5) * size / count).astype(int)
        within = np.flatnonzero((nearest >= extent.start) & (nearest < extent.stop))
        taken.append(nearest[within] - extent.start)
        places.append(within)
    result[np.ix_(*places)] = similarity[np.ix_(*taken)]
    return result


def _on_grid(similarity: np.ndarray, grid: Shape) -> np.ndarray:
    """A map with the shape of the finest, or of the volume if that is coarser; uint8 if its shape changed."""
    if similarity.dtype != np.uint8:
        similarity = np.nan_to_num(similarity.astype(np.float32, copy=False))
    if similarity.shape == grid:
        return similarity
    if math.prod(similarity.shape) > math.prod(grid):
        return nearest_voxels(similarity, grid)
    scale = 1.0 if similarity.dtype == np.uint8 else 255.0
    positions = [cell_positions(cells, voxels) for cells, voxels in zip(similarity.shape, grid, strict=True)]
    fine = interpolated(similarity, positions, cubic=True)
    return np.clip(np.rint(scale * fine), 0.0, 255.0).astype(np.uint8)


def _ratios(similarity: np.ndarray, iso: float) -> np.ndarray:
    """A map's values in multiples of its iso value, uint16 with 1 as `UNIT`; what exceeds 16 is 16."""
    # An iso value of 0 takes in whatever is above 0.
    unit = UNIT / max(iso, 1e-3)
    if similarity.dtype == np.uint8:
        of_bytes: np.ndarray = np.minimum(np.arange(256) * (unit / 255.0), 65535.0).astype(np.uint16)[similarity]
        return of_bytes
    ratios: np.ndarray = np.clip(similarity * np.float32(unit), 0.0, 65535.0).astype(np.uint16)
    return ratios


def _rise(ratios: np.ndarray, softness: float, cell_sizes: Sequence[float]) -> np.ndarray:
    """The membership for every ratio, (65536,) uint8: a rise over a distance of `softness` to either side of the surface."""
    half = softness * _slope(ratios, cell_sizes)
    below = max(min(half, (1.0 - NEAR_SHARE_OF_ISO) * UNIT), 1.0)
    inside = ratios[ratios >= UNIT]
    # What is typical well inside must be reached.
    above = max(min(half, 0.8 * (float(np.percentile(inside[::5], 95)) - UNIT)), 1.0) if inside.size else below
    rise = np.interp(np.arange(65536), [UNIT - below, UNIT, UNIT + above], [0.0, 127.5, 255.0])
    return rise.astype(np.uint8)


def _slope(ratios: np.ndarray, cell_sizes: Sequence[float]) -> float:
    """How much ratios typically change over a distance of 1, across the surface."""
    inside = ratios >= UNIT
    differences = []
    for axis in range(3):
        near, far = _pairs(ratios, axis)
        crossing = np.logical_xor(*_pairs(inside, axis))
        differences.append(np.abs(near[crossing].astype(np.int32) - far[crossing]) / cell_sizes[axis])
    across = np.concatenate(differences)
    # Along an axis, a slope in a random direction shows with 0.7 of its size, weighted by how often it crosses.
    return float(np.median(across)) / 0.7 if across.size else 0.0


def _pairs(array: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours along an axis: views on all elements but the last, and on all but the first."""
    along = np.moveaxis(array, axis, 0)
    return along[:-1], along[1:]


def _refined(ratios: np.ndarray, box: Box, grid: Shape, shape: Shape) -> tuple[Box, np.ndarray]:
    """Ratios in a box of the grid, at the voxels of the volume that it covers: smooth, so that surfaces have no facets."""
    fine_box = covering_box(box, grid, shape)
    positions = [
        cell_positions(cells, voxels, fine) - extent.start
        for extent, fine, cells, voxels in zip(box, fine_box, grid, shape, strict=True)
    ]
    return fine_box, np.clip(interpolated(ratios, positions, cubic=True), 0.0, 65535.0).astype(np.uint16)
