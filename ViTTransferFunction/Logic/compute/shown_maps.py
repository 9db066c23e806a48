"""The maps that are shown, S_H of some classes and S_L of others, of one part of the volume."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.classes.class_map import FULL_SCALE, NEAR_SHARE_OF_ISO, ClassMap, box_above
from ..core.volumes.bounding_box import common_box, covering_box, grown, whole_box, within
from ..core.volumes.geometry import Box
from ..core.volumes.resampling import interpolated
from ..rendering.class_membership import Map, PartialMap, Shape
from ..rendering.composition import VOXEL_BUDGET, shape_within_budget
from ..rendering.iso_surfaces import VOXELS_FROM_CELLS
from ..session.map_crop import MapCrop

FILTER_REACH_CELLS = 2
"""How far beyond the cells that a value lies between `interpolated` looks, at most."""

Shown = MapCrop | ClassMap
"""S_H, or S_L."""


def on_one_box(maps: Sequence[Shown], whole: Shape, surroundings: bool = False) -> tuple[list[Map], Box, Shape | None]:
    """Maps on the smallest box of a volume that matters to all of them; of S_L alone, on all of it.

    Args:
        maps: of the volume.
        whole: its shape, (K, J, I).
        surroundings: whether all of the volume matters.

    Returns:
        The maps, of which all are of the same box though their shapes may differ; the box; and the shape that they are to be
        rendered in: where some are S_L, somebody waits for the answer to a click. None: any.
    """
    crops, lows = [each for each in maps if isinstance(each, MapCrop)], [each for each in maps if isinstance(each, ClassMap)]
    if not crops:
        return [low.array for low in lows], whole_box(whole), shape_within_budget(whole) if surroundings else None
    near = [*(crop.box for crop in crops), *(covering_box(_near_cells(low), low.array.shape, whole) for low in lows)]
    box = whole_box(whole) if surroundings else common_box(near)
    k, j, i = (extent.stop - extent.start for extent in box)
    grid = shape_within_budget((k, j, i), VOXEL_BUDGET if surroundings else VOXELS_FROM_CELLS)
    shown: list[Map] = [_in_box(each, box) if isinstance(each, MapCrop) else _on_grid(each, whole, box, grid) for each in maps]
    return shown, box, grid if surroundings or (lows and grid != (k, j, i)) else None


def _in_box(crop: MapCrop, box: Box) -> PartialMap:
    """S_H of a box of the volume that holds the crop."""
    k, j, i = (extent.stop - extent.start for extent in box)
    return PartialMap(crop.array, within(crop.box, box), (k, j, i))


def _near_cells(low: ClassMap) -> Box:
    """The cells around the iso-surface, and within."""
    return box_above(low.array, NEAR_SHARE_OF_ISO * low.iso, margin=1) or (slice(0, 2),) * 3


def _on_grid(low: ClassMap, whole: Shape, box: Box, grid: Shape) -> PartialMap:
    """S_L on a grid that fills a box of the volume, smooth between cells, uint8; 0 away from the iso-surface."""
    cells = low.array.shape
    near = _near_cells(low)
    needed = grown(near, (FILTER_REACH_CELLS,) * 3, whole_box(cells))
    positions, places = [], []
    for axis, (extent, count) in enumerate(zip(box, grid, strict=True)):
        in_voxels = extent.start + (np.arange(count) + 0.5) * ((extent.stop - extent.start) / count)
        in_cells = in_voxels * (cells[axis] / whole[axis]) - 0.5
        places.append(slice(*np.searchsorted(in_cells, (near[axis].start - 0.5, near[axis].stop - 0.5)).tolist()))
        positions.append(in_cells[places[-1]] - needed[axis].start)
    smooth = np.clip(interpolated(low.array[needed], positions, cubic=True), 0.0, 1.0)
    k, j, i = places
    return PartialMap(np.rint(smooth * np.float32(FULL_SCALE)).astype(np.uint8), (k, j, i), grid)
