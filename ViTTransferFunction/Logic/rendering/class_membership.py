"""How surely each voxel belongs to each class, from similarity maps of any resolution: where 3D renderings start from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..core.classes.class_map import NEAR_SHARE_OF_ISO, box_above
from ..core.volumes.bounding_box import common_part, covering_box, grown, out_of, whole_box, within
from ..core.volumes.geometry import Box
from ..core.volumes.resampling import cell_positions, interpolated
from .lookup import looked_up

Shape = tuple[int, int, int]

UNIT = 4096
"""A ratio of 1 between a map and its iso value, as an integer."""


NEAR_MARGIN = 2
"""Margin, in cells, around the box in which a map is near its iso value."""


@dataclass(frozen=True, eq=False)
class PartialMap:
    """A map that is 0 outside a box.

    Attributes:
        array: the values in the box, (k, j, i), float32 in [0, 1] or uint8 with 255 for 1.
        box: the box, in the map's cells.
        shape: (K, J, I) of the whole map.
    """

    array: np.ndarray
    box: Box
    shape: Shape

    def on(self, box: Box) -> np.ndarray:
        """The map's values in any box of its cells; 0 outside its own box."""
        common = common_part(box, self.box)
        if common == box:
            return self.array[within(box, self.box)]
        result = np.zeros([extent.stop - extent.start for extent in box], dtype=self.array.dtype)
        if common is not None:
            result[within(common, box)] = self.array[within(common, self.box)]
        return result


Map = np.ndarray | PartialMap
"""(K, J, I), float32 in [0, 1] or uint8 with 255 for 1."""


class Membership(NamedTuple):
    """How surely the voxels around a class belong to it.

    Attributes:
        box: the part of the volume; voxels outside it do not belong to the class.
        values: (k, j, i) uint8: 0 outside, between 127 and 128 on the surface, 255 inside.
    """

    box: Box
    values: np.ndarray


def memberships(
    maps: Sequence[Map],
    isos: Sequence[float],
    shape: Shape,
    softness_voxels: Sequence[float],
    cell_sizes: Sequence[float] = (1.0, 1.0, 1.0),
) -> Iterator[tuple[int, Membership]]:
    """Yields the index of each class and its membership; classes whose map is nowhere near its iso value are left out.

    The surface of a class is where its map reaches its iso value or, where classes overlap, where another class's map exceeds
    its own iso value by the same factor, as in `Competition` of `session/labels.py`.

    Args:
        maps: maps of the same part of the volume, possibly of different shapes.
        isos: for each map, its iso value in [0, 1].
        shape: (K', J', I') of the volume that memberships are computed for; it covers the same box as the maps.
        softness_voxels: for each class, half the distance over which its membership rises from 0 to 255, in voxels of that
            volume. The distance is shorter where the map is too low or too steep.
        cell_sizes: edges of the finest map's cells along K, J, I, in any unit; if cells are not cubes, slopes differ along the
            axes.
    """
    grid = finest_shape(maps)
    if math.prod(grid) > math.prod(shape):
        grid = shape
    voxel_size = min(size * cells / voxels for size, cells, voxels in zip(cell_sizes, grid, shape, strict=True))
    near: dict[int, Membership] = {}
    for index, iso in enumerate(isos):
        similarity = _on_grid(maps[index], grid)
        found = box_above(similarity.array, NEAR_SHARE_OF_ISO * iso, margin=0)
        if found is not None:
            box = grown(out_of(found, similarity.box), (NEAR_MARGIN,) * 3, whole_box(grid))
            near[index] = Membership(box, _ratios(similarity.on(box), iso))
    competition = _Competition(near, grid)
    for index, (box, ratios) in near.items():
        competition.take_from(index)
        rise = _rise(ratios, softness_voxels[index] * voxel_size, cell_sizes)
        if grid != shape:
            box, ratios = _refined(ratios, box, grid, shape)
        yield index, Membership(box, looked_up(rise, ratios))


class _Competition:
    """Lowers the ratios of classes where they overlap; only the boxes in which maps are near their iso values count.

    Args:
        near: for each class, this box and the ratios in it (`_ratios`).
        grid: shape (K, J, I) of the grid that boxes refer to.
    """

    def __init__(self, near: Mapping[int, Membership], grid: Shape) -> None:
        self._near = near
        self._contested = _contested({index: box for index, (box, _) in near.items()})
        self._largest, self._second = np.zeros(grid, dtype=np.uint16), np.zeros(grid, dtype=np.uint16)
        for index, box in self._contested.items():
            largest, second, ratios = self._largest[box], self._second[box], self._ratios(index, box)
            np.maximum(second, np.minimum(largest, ratios), out=second)
            np.maximum(largest, ratios, out=largest)

    def take_from(self, index: int) -> None:
        """Lower a class's ratios by as much as the largest other ratio exceeds 1; other classes' ratios do not change."""
        box = self._contested.get(index)
        if box is not None:
            largest, ratios = self._largest[box], self._ratios(index, box)
            others = np.where(ratios == largest, self._second[box], largest)
            ratios -= np.minimum(ratios, np.maximum(others, UNIT) - UNIT)

    def _ratios(self, index: int, box: Box) -> np.ndarray:
        near = self._near[index]
        return near.values[within(box, near.box)]


def _contested(boxes: Mapping[int, Box]) -> dict[int, Box]:
    """For each box that overlaps others, the smallest box around its overlaps."""
    ends = np.array([[(extent.start, extent.stop) for extent in box] for box in boxes.values()]).reshape(-1, 3, 2)
    contested = {}
    for place, index in enumerate(boxes):
        others = np.delete(ends, place, axis=0)
        first, stop = np.maximum(ends[place, :, 0], others[..., 0]), np.minimum(ends[place, :, 1], others[..., 1])
        overlap = (first < stop).all(axis=1)
        if overlap.any():
            k, j, i = map(slice, first[overlap].min(axis=0).tolist(), stop[overlap].max(axis=0).tolist())
            contested[index] = k, j, i
    return contested


def finest_shape(maps: Sequence[Map]) -> Shape:
    """The shape of the map with the most cells."""
    return max((similarity.shape for similarity in maps), key=np.prod)


def nearest_voxels(array: np.ndarray, shape: Shape, part: Box | None = None) -> np.ndarray:
    """`array` at a coarser `shape` of the same box, or at a part of that: of each voxel the value nearest to its centre."""
    part = part or whole_box(shape)
    if array.shape == shape:
        return array[part]
    k, j, i = (_nearest(*counts)[extent] for *counts, extent in zip(shape, array.shape, part, strict=True))
    return _picked(array, k, j, i)


def _nearest(count: int, size: int) -> np.ndarray:
    """Of each of `count` voxels along an axis, which of `size` finer ones lies nearest to its centre."""
    nearest: np.ndarray = ((np.arange(count) + 0.5) * size / count).astype(int)
    return nearest


def _on_grid(similarity: Map, grid: Shape) -> PartialMap:
    """A map with the shape of the finest, or of the volume if that is coarser; uint8 if it is finer than it was."""
    if not isinstance(similarity, PartialMap):
        similarity = PartialMap(similarity, whole_box(similarity.shape), similarity.shape)
    if similarity.array.dtype != np.uint8:
        similarity = replace(similarity, array=np.nan_to_num(similarity.array.astype(np.float32, copy=False)))
    if similarity.shape == grid:
        return similarity
    if math.prod(similarity.shape) > math.prod(grid):
        return _coarser(similarity, grid)
    scale = 1.0 if similarity.array.dtype == np.uint8 else 255.0
    positions = [cell_positions(cells, voxels) for cells, voxels in zip(similarity.shape, grid, strict=True)]
    fine = interpolated(similarity.on(whole_box(similarity.shape)), positions, cubic=True)
    return PartialMap(np.clip(np.rint(scale * fine), 0.0, 255.0).astype(np.uint8), whole_box(grid), grid)


def _coarser(similarity: PartialMap, grid: Shape) -> PartialMap:
    """A map on a coarser grid, as `nearest_voxels` has it."""
    indices, places = [], []
    for extent, count, size in zip(similarity.box, grid, similarity.shape, strict=True):
        nearest = _nearest(count, size)
        places.append(slice(*np.searchsorted(nearest, (extent.start, extent.stop)).tolist()))
        indices.append(nearest[places[-1]] - extent.start)
    k, j, i = places
    return PartialMap(_picked(similarity.array, *indices), (k, j, i), grid)


def _picked(array: np.ndarray, k: np.ndarray, j: np.ndarray, i: np.ndarray) -> np.ndarray:
    """`array` (K, J, I) at all combinations of indices along its axes."""
    picked = np.empty((len(k), len(j), len(i)), dtype=array.dtype)
    # Plane by plane, which is many times faster than axis by axis.
    in_plane = j[:, None] * array.shape[2] + i
    for plane, index in zip(picked, k.tolist(), strict=True):
        np.take(array[index], in_plane, mode="clip", out=plane)
    return picked


def _ratios(similarity: np.ndarray, iso: float) -> np.ndarray:
    """A map's values in multiples of its iso value, uint16 with 1 as `UNIT`; what exceeds 16 is 16."""
    # An iso value of 0 takes in whatever is above 0.
    unit = UNIT / max(iso, 1e-3)
    if similarity.dtype == np.uint8:
        return looked_up(np.minimum(np.arange(256) * (unit / 255.0), 65535.0).astype(np.uint16), similarity)
    ratios: np.ndarray = np.clip(similarity * np.float32(unit), 0.0, 65535.0).astype(np.uint16)
    return ratios


def _rise(ratios: np.ndarray, softness: float, cell_sizes: Sequence[float]) -> np.ndarray:
    """The membership for every ratio, (65536,) uint8: a rise over a distance of `softness` to either side of the surface."""
    inside = ratios >= UNIT
    half = softness * _slope(ratios, inside, cell_sizes)
    below = max(min(half, (1.0 - NEAR_SHARE_OF_ISO) * UNIT), 1.0)
    sample = ratios[inside][::5]
    # What is typical well inside must be reached.
    above = max(min(half, 0.8 * (float(np.percentile(sample, 95)) - UNIT)), 1.0) if sample.size else below
    rise = np.zeros(65536, dtype=np.uint8)
    low, high = math.floor(UNIT - below), math.ceil(UNIT + above)
    rise[low:high] = np.interp(np.arange(low, high), [UNIT - below, UNIT, UNIT + above], [0.0, 127.5, 255.0])
    rise[high:] = 255
    return rise


def _slope(ratios: np.ndarray, inside: np.ndarray, cell_sizes: Sequence[float]) -> float:
    """How much ratios typically change over a distance of 1, across the surface."""
    flat, differences = ratios.ravel(), []
    for axis, cell_size in enumerate(cell_sizes):
        crossing = np.zeros(inside.shape, dtype=bool)
        near, far = _pairs(inside, axis)
        np.not_equal(near, far, out=_pairs(crossing, axis)[0])
        at = np.flatnonzero(crossing)
        beyond = at + math.prod(inside.shape[axis + 1 :])
        differences.append(np.abs(flat[at].astype(np.int32) - flat[beyond]) / cell_size)
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
