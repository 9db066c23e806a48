"""The maps that are shown, S_H of some classes and S_L of others, as arrays that fill one part of the volume."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.bounding_box import common_box, covering_box, whole_box
from ..core.class_map import FULL_SCALE, NEAR_SHARE_OF_ISO, ClassMap, box_above
from ..core.geometry import Box
from ..core.resampling import interpolated
from ..rendering.class_membership import Shape, on_whole_grid
from ..rendering.composition import shape_within_budget
from ..rendering.iso_surfaces import VOXELS_FROM_CELLS
from ..session.map_crop import MapCrop, on_common_box

Shown = MapCrop | ClassMap
"""S_H, or S_L."""


def on_one_box(maps: Sequence[Shown], whole: Shape, surroundings: bool = False) -> tuple[list[np.ndarray], Box, Shape | None]:
    """The arrays of maps on the smallest box of a volume that matters to all of them; of S_L alone, on all of it.

    Args:
        maps: of the volume.
        whole: its shape, (K, J, I).
        surroundings: whether all of the volume matters.

    Returns:
        An array for each map, (K, J, I), of which all fill the same box though their shapes may differ; the box; and the shape
        that they are to be rendered in: where some are S_L, somebody waits for the answer to a click. None: any.
    """
    if surroundings:
        shape = shape_within_budget(whole)
        return [_on_all(each, whole, shape) for each in maps], whole_box(whole), shape
    crops, lows = [each for each in maps if isinstance(each, MapCrop)], [each for each in maps if isinstance(each, ClassMap)]
    if not crops:
        return [low.array for low in lows], whole_box(whole), None
    if not lows:
        return *on_common_box(crops), None
    box = common_box([*(crop.box for crop in crops), *(covering_box(_near_cells(low), low.array.shape, whole) for low in lows)])
    k, j, i = (extent.stop - extent.start for extent in box)
    grid = shape_within_budget((k, j, i), VOXELS_FROM_CELLS)
    arrays = [each.on_box(box) if isinstance(each, MapCrop) else _on_grid(each, whole, box, grid) for each in maps]
    return arrays, box, None if grid == (k, j, i) else grid


def _on_all(shown: Shown, whole: Shape, shape: Shape) -> np.ndarray:
    """The array of a map on all of a volume, S_H on a grid of `shape`, which is not finer."""
    return on_whole_grid(shown.array, shown.box, whole, shape) if isinstance(shown, MapCrop) else shown.array


def _near_cells(low: ClassMap) -> Box:
    """The cells around the iso-surface, and within."""
    return box_above(low.array, NEAR_SHARE_OF_ISO * low.iso, margin=1) or (slice(0, 2),) * 3


def _on_grid(low: ClassMap, whole: Shape, box: Box, grid: Shape) -> np.ndarray:
    """S_L on a grid that fills a box of the volume, smooth between cells, uint8; 0 away from the iso-surface."""
    positions, near = [], []
    shapes = zip(box, grid, low.array.shape, whole, _near_cells(low), strict=True)
    for extent, count, cells, voxels, of_cells in shapes:
        in_voxels = extent.start + (np.arange(count) + 0.5) * ((extent.stop - extent.start) / count)
        in_cells = in_voxels * (cells / voxels) - 0.5
        near.append(slice(*np.searchsorted(in_cells, (of_cells.start - 0.5, of_cells.stop - 0.5)).tolist()))
        positions.append(in_cells[near[-1]])
    smooth = np.clip(interpolated(low.array, positions, cubic=True), 0.0, 1.0)
    array = np.zeros(grid, dtype=np.uint8)
    array[tuple(near)] = np.rint(smooth * np.float32(FULL_SCALE))
    return array
