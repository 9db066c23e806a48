"""A volume's intensities, averaged over blocks. Blocks subdivide the feature cells, to resolve what is thinner than a cell.

Intensities are 16-bit integers, scaled such that the display window is 1024 wide.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ..core.volumes.geometry import Geometry
from ..core.volumes.intensity_window import IntensityWindow
from ..core.volumes.orientation import canonical_orientation
from ..core.volumes.torch_arrays import array_of, tensor_of
from ..core.volumes.volume import Volume

BLOCKS_PER_CELL = 2
"""Along each axis: walls between structures may be thinner than a cell."""
UNITS_PER_WINDOW = 1024
"""Comparing 16-bit integers takes a fifth of the time."""
UNKNOWN = 20_000
"""The value of blocks without a finite voxel, far from all other values."""
MUCH_THICKER = 1.6
"""Neighbours along an axis count as near if the spacing there is at most this many times the smallest spacing."""
_FURTHEST = 10_000
"""Intensities are clipped to this distance, about ten windows, from the middle of the window, so that differences fit into 16
bits."""
MOST_BLOCKS = 2_200_000
"""If there would be more, each cell is one block: the time that a new point takes is proportional to the number of blocks."""


class IntensityBlocks:
    """The blocks of a volume. A block is given by its indices along K, J and I.

    Args:
        volume: the volume; voxels that are not finite are ignored.
        cells: the grid of the feature cells, which covers the volume's box.
        window: the window in which a person would view the volume (`display_window`).
        per_cell: blocks per cell along each axis; 1 is used instead if there would be too many blocks (`MOST_BLOCKS`).

    Attributes:
        units: (K, J, I) int16, mean intensity of each block relative to the middle of the window, which is `UNITS_PER_WINDOW`
            wide; or `UNKNOWN`.
        per_cell: blocks per cell along each axis.
        cells: the grid of the feature cells.
    """

    def __init__(self, volume: Volume, cells: Geometry, window: IntensityWindow, per_cell: int = BLOCKS_PER_CELL) -> None:
        fits = int(np.prod(cells.shape)) * per_cell**3 <= MOST_BLOCKS
        self.per_cell = per_cell if fits else 1
        k, j, i = (self.per_cell * count for count in cells.shape)
        self.units = _in_units(block_means(volume.array, (k, j, i)), window)
        self.cells, self._volume, self._window = cells, volume, window

    def nearest(self, points_ras: np.ndarray) -> np.ndarray:
        """The blocks (N, 3) that contain points (N, 3), RAS millimetres; for points outside the volume, the nearest blocks."""
        return self.cells.nearest_voxels(points_ras, self.per_cell)

    def centres_ras(self, blocks: np.ndarray) -> np.ndarray:
        """Centres of blocks (N, 3), (N, 3) RAS millimetres."""
        return self.cells.ijk_to_ras_points(((blocks + 0.5) / self.per_cell - 0.5)[:, ::-1])

    def units_of(self, blocks: np.ndarray) -> np.ndarray:
        """Intensities of blocks, (…, 3) → (…), float64."""
        units: np.ndarray = self.units[blocks[..., 0], blocks[..., 1], blocks[..., 2]].astype(float)
        return units

    def units_of_voxels_at(self, points_ras: np.ndarray) -> np.ndarray:
        """Median intensity of the voxel at each point (N, 3), RAS millimetres, and its neighbours: (N,) float64, as `units`.

        Neighbours along an axis with much larger spacing do not count. `UNKNOWN` if none of the voxels is finite.
        """
        geometry = self._volume.geometry
        spacing = geometry.spacing_mm[::-1]
        beside = (spacing <= MUCH_THICKER * spacing.min()).astype(int)
        medians = np.full(len(points_ras), np.nan, dtype=np.float32)
        for point, voxel in enumerate(geometry.nearest_voxels(points_ras)):
            around = tuple(slice(max(at - step, 0), at + step + 1) for at, step in zip(voxel, beside, strict=True))
            values = self._volume.array[around].astype(np.float32)
            known = values[np.isfinite(values)]
            if known.size:
                medians[point] = np.median(known)
        return _in_units(medians, self._window).astype(float)

    def in_cells_of(self, blocks: np.ndarray) -> np.ndarray:
        """All blocks of the cells that contain blocks (N, 3): (N, per_cell³, 3).

        Their order follows the patient's axes, so that the first of several equally good blocks does not depend on the axis
        order in which the volume is stored.
        """
        per_cell = self.per_cell
        steps = np.indices((per_cell,) * 3)
        first, second, third = (canonical_orientation(self.cells).to_canonical(along).ravel()[::-1] for along in steps)
        in_cells: np.ndarray = (blocks - blocks % per_cell)[:, None] + np.stack([first, second, third], axis=1)
        return in_cells

    def within(self, radius: float, block: np.ndarray) -> np.ndarray:
        """All blocks (N, 3) within a radius, in blocks, around a block (3,), itself included."""
        blocks = block + _steps_within(radius)
        inside: np.ndarray = blocks[((blocks >= 0) & (blocks < self.units.shape)).all(axis=1)]
        return inside

    def cell_units(self) -> np.ndarray:
        """Mean of each cell's known blocks, (K, J, I) of the cells, int16 as `units`."""
        per_cell = self.per_cell
        total, count = np.zeros((2, *self.cells.shape), dtype=np.int32)
        # Adding strided arrays is six times as fast as summing along three of six axes.
        for first in np.ndindex(per_cell, per_cell, per_cell):
            units = self.units[tuple(slice(start, None, per_cell) for start in first)]
            known = units != UNKNOWN
            total += np.where(known, units, 0)
            count += known
        means: np.ndarray = np.where(count > 0, np.rint(total / np.maximum(count, 1)), UNKNOWN).astype(np.int16)
        return means

    def cell_means(self) -> np.ndarray:
        """Mean intensity of each cell (K, J, I), float32, with the precision of `cell_units`; NaN if no voxel is finite."""
        units, window = self.cell_units(), self._window
        means = units * np.float32(window.width / UNITS_PER_WINDOW) + np.float32(0.5 * (window.low + window.high))
        known: np.ndarray = np.where(units == UNKNOWN, np.float32(np.nan), means)
        return known


def block_means(array: np.ndarray, blocks: tuple[int, int, int]) -> np.ndarray:
    """Mean intensity of each block, float32; NaN if no voxel of the block is finite.

    Args:
        array: (K, J, I), any real dtype; voxels that are not finite are ignored.
        blocks: number of blocks along (K, J, I); a voxel that a border between blocks cuts counts for both.
    """
    count, rows, columns = blocks
    means = np.empty(blocks, dtype=np.float32)
    for index in range(count):
        # A few slices at a time, to avoid a float32 copy of the volume.
        slices = array[index * len(array) // count : -(-(index + 1) * len(array) // count)].astype(np.float32)
        finite = np.isfinite(slices)
        # Some scans mark missing voxels by the largest float32, whose sums overflow.
        with np.errstate(over="ignore"):
            if finite.all():
                # The same result as below in half the time.
                means[index] = _pooled(slices.sum(axis=0)[None], rows, columns)[0] / np.float32(len(slices))
                continue
            sums = np.stack([np.where(finite, slices, 0.0).sum(axis=0), finite.sum(axis=0, dtype=np.float32)])
            total, known = _pooled(sums, rows, columns)
            means[index] = np.where(known > 0.0, total / np.maximum(known, np.float32(1e-6)), np.nan)
    return means


def _pooled(images: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Block means of images: (N, J, I) float32 to (N, rows, columns)."""
    import torch.nn.functional as F

    return array_of(F.adaptive_avg_pool2d(tensor_of(images), (rows, columns)))


def _in_units(means: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """Mean intensities, NaN if unknown, converted to int16 as `IntensityBlocks.units`."""
    with np.errstate(over="ignore"):
        units = (means - np.float32(0.5 * (window.low + window.high))) * np.float32(UNITS_PER_WINDOW / window.width)
    in_range = np.clip(np.rint(units), -_FURTHEST, _FURTHEST)
    whole_numbers: np.ndarray = np.where(np.isnan(units), UNKNOWN, in_range).astype(np.int16)
    return whole_numbers


@cache
def _steps_within(radius: float) -> np.ndarray:
    """All offsets (N, 3) along K, J, I that are no longer than a radius."""
    reach = int(radius)
    steps = np.indices((2 * reach + 1,) * 3).reshape(3, -1).T - reach
    near: np.ndarray = steps[np.linalg.norm(steps, axis=1) <= radius]
    return near
