"""A few points that stand for a structure whose voxels are known: well inside it, far from each other, in each of its parts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..volumes.geometry import Box, Geometry
from ..volumes.stepped_work import Steps
from .spread_points import spread_points

MAX_CELLS = 50_000
"""Cells in which a structure is looked at: its depth is then found within one short step, and is still as fine as 4 % of its
extent, or as two voxels."""
CORE_SHARE = 0.6
"""Points lie where a part is at least this deep, of its own largest depth: away from a border that may be wrong."""
SMALLEST_PART = 0.05
"""Parts that hold a smaller share of the structure get no point of their own: they are specks rather than parts."""


def points_in_label(labels: np.ndarray, label: int, box: Box, geometry: Geometry, count: int) -> Steps[np.ndarray]:
    """Points in the voxels of a label; in steps.

    Args:
        labels: (K, J, I).
        label: which of them.
        box: that holds the label's voxels.
        geometry: of all of `labels`; distances are in millimetres.
        count: how many points, where there is room for as many. More where more parts have a relevant size.

    Returns:
        (N, 3) RAS millimetres, each the centre of a voxel of the label; none where there is no such voxel.
    """
    cells = yield from _occupancy(labels, label, box, geometry)
    chosen = _chosen_cells(cells, count)
    yield 0
    voxels = [_voxel_in_cell(labels, label, box, cells.steps, cell) for cell in chosen]
    return geometry.ijk_to_ras_points(np.array(voxels, dtype=np.float64).reshape(-1, 3)[:, ::-1])


@dataclass(frozen=True, eq=False)
class _Cells:
    """How many voxels of a structure lie in each cell (K', J', I'), and how many voxels long cells are along K, J and I."""

    counts: np.ndarray
    steps: tuple[int, int, int]
    spacing_mm: np.ndarray


def _occupancy(labels: np.ndarray, label: int, box: Box, geometry: Geometry) -> Steps[_Cells]:
    spacing_mm = geometry.spacing_mm[::-1]
    steps = _cell_steps([extent.stop - extent.start for extent in box], spacing_mm)
    k, j, i = box
    starts_j, starts_i = (
        np.arange(0, extent.stop - extent.start, step) for extent, step in zip((j, i), steps[1:], strict=True)
    )
    layers = []
    for start in range(k.start, k.stop, steps[0]):
        inside = labels[start : min(start + steps[0], k.stop), j, i] == label
        rows = np.add.reduceat(inside.sum(axis=0, dtype=np.int32), starts_j, axis=0)
        layers.append(np.add.reduceat(rows, starts_i, axis=1))
        yield inside.size
    return _Cells(np.array(layers), steps, spacing_mm * steps)


def _cell_steps(shape: list[int], spacing_mm: np.ndarray) -> tuple[int, int, int]:
    """Voxels along each edge of a cell, such that cells are about as long as wide and not too many."""
    edge_mm = spacing_mm.min()
    while True:
        k, j, i = (max(int(edge_mm / spacing), 1) for spacing in spacing_mm)
        if math.prod([-(-size // step) for size, step in zip(shape, (k, j, i), strict=True)]) <= MAX_CELLS:
            return k, j, i
        edge_mm *= 1.1


def _chosen_cells(cells: _Cells, count: int) -> np.ndarray:
    """The deepest cell of each relevant part, and then again and again the core's cell farthest from all so far, (N, 3)."""
    # Where a structure is thinner than cells are, none is full.
    inside = cells.counts >= max(0.5 * cells.counts.max(initial=0), 1)
    parts, number = ndimage.label(inside, structure=np.ones((3, 3, 3)))
    if number == 0:
        return np.empty((0, 3), dtype=int)
    sizes = ndimage.sum_labels(cells.counts, parts, np.arange(1, number + 1))
    largest_first = (np.argsort(-sizes) + 1).tolist()
    relevant = [part for part in largest_first if sizes[part - 1] >= SMALLEST_PART * sizes.sum()]
    # Of many like parts, metastases say, none is a relevant share of all.
    relevant = relevant or largest_first[:count]
    depth = ndimage.distance_transform_edt(np.pad(inside, 1), sampling=cells.spacing_mm)[1:-1, 1:-1, 1:-1]
    deepest = ndimage.maximum_position(depth, parts, relevant)
    largest = np.zeros(number + 1)
    largest[relevant] = [depth[place] for place in deepest]
    core = np.argwhere((largest[parts] > 0.0) & (depth >= CORE_SHARE * largest[parts]))
    first = [int(np.flatnonzero((core == place).all(axis=1))[0]) for place in deepest]
    chosen: np.ndarray = core[spread_points(core * cells.spacing_mm, first, count, cells.spacing_mm.min())]
    return chosen


def _voxel_in_cell(labels: np.ndarray, label: int, box: Box, steps: tuple[int, int, int], cell: np.ndarray) -> np.ndarray:
    """The (k, j, i) of the label's voxel that is nearest to the middle of its voxels in a cell."""
    starts = [extent.start + index * step for extent, index, step in zip(box, cell.tolist(), steps, strict=True)]
    ends = [min(start + step, extent.stop) for start, step, extent in zip(starts, steps, box, strict=True)]
    within = labels[tuple(slice(start, end) for start, end in zip(starts, ends, strict=True))]
    voxels = np.argwhere(within == label)
    nearest = np.argmin(np.linalg.norm(voxels - voxels.mean(axis=0), axis=1))
    place: np.ndarray = voxels[nearest] + starts
    return place
