"""A volume's intensities in blocks, which divide the feature cells: what is too thin for a cell is seen in them.

They are kept as 16-bit numbers, in units of which the display window is 1024 wide.
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
"""Along each axis: a wall between two structures is thinner than a cell."""
UNITS_PER_WINDOW = 1024
"""Intensities are compared as 16-bit numbers, which takes a fifth of the time."""
UNKNOWN = 20_000
"""Stands for blocks without a finite voxel; it is far from all others."""
MUCH_THICKER = 1.6
"""How much longer than its shortest edge a voxel may be along an axis for those beside it there to be near."""
_FURTHEST = 10_000
"""What lies more than ten windows from the middle of the window counts as that far. No difference leaves 16 bits."""
MOST_BLOCKS = 2_200_000
"""Where there would be more, each cell is one block: a new point takes time in proportion to them."""


class IntensityBlocks:
    """The blocks of a volume. A block is given by its index along K, J, I.

    Args:
        volume: the intensities; voxels that are not finite are passed over.
        cells: the feature cells, which fill the volume's box.
        window: in which a person would look at them (`display_window`).
        per_cell: how many, along each axis; one, where that would be too many blocks.

    Attributes:
        units: intensities of all blocks (K, J, I), int16, in `UNITS_PER_WINDOW` from the middle of the window, or `UNKNOWN`.
        per_cell: blocks along each axis of a cell.
        cells: the feature cells.
    """

    def __init__(self, volume: Volume, cells: Geometry, window: IntensityWindow, per_cell: int = BLOCKS_PER_CELL) -> None:
        fits = int(np.prod(cells.shape)) * per_cell**3 <= MOST_BLOCKS
        self.per_cell = per_cell if fits else 1
        k, j, i = (self.per_cell * count for count in cells.shape)
        self.units = _in_units(block_means(volume.array, (k, j, i)), window)
        self.cells, self._volume, self._window = cells, volume, window

    def nearest(self, points_ras: np.ndarray) -> np.ndarray:
        """The blocks (N, 3) of points (N, 3), RAS millimetres; outside of the volume, the nearest ones."""
        return self.cells.nearest_voxels(points_ras, self.per_cell)

    def centres_ras(self, blocks: np.ndarray) -> np.ndarray:
        """Centres of blocks (N, 3), (N, 3) RAS millimetres."""
        return self.cells.ijk_to_ras_points(((blocks + 0.5) / self.per_cell - 0.5)[:, ::-1])

    def units_of(self, blocks: np.ndarray) -> np.ndarray:
        """Intensities of blocks, (…, 3) → (…), float64."""
        units: np.ndarray = self.units[blocks[..., 0], blocks[..., 1], blocks[..., 2]].astype(float)
        return units

    def units_of_voxels_at(self, points_ras: np.ndarray) -> np.ndarray:
        """Median intensities of the voxels at points (N, 3), RAS millimetres, and of those beside them, (N,), float64.

        Voxels beside them along an axis along which they are much thicker do not count. `UNKNOWN` where none is finite.
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
        """All blocks of the cells that blocks (N, 3) lie in, (N, per_cell³, 3), in an order that is that of the patient's axes.

        So the first of several that are as good is the same one in whatever order a volume is stored.
        """
        per_cell = self.per_cell
        steps = np.indices((per_cell,) * 3)
        first, second, third = (canonical_orientation(self.cells).to_canonical(along).ravel()[::-1] for along in steps)
        in_cells: np.ndarray = (blocks - blocks % per_cell)[:, None] + np.stack([first, second, third], axis=1)
        return in_cells

    def within(self, radius: float, block: np.ndarray) -> np.ndarray:
        """The blocks (N, 3) no farther than so many blocks from one of them, (3,): itself as well."""
        blocks = block + _steps_within(radius)
        inside: np.ndarray = blocks[((blocks >= 0) & (blocks < self.units.shape)).all(axis=1)]
        return inside

    def cell_units(self) -> np.ndarray:
        """Mean of each cell's blocks that are known, (K, J, I) of the cells, int16 as `units`."""
        per_cell = self.per_cell
        total, count = np.zeros((2, *self.cells.shape), dtype=np.int32)
        # One block of every cell after the other: six times as fast as sums along three of six axes.
        for first in np.ndindex(per_cell, per_cell, per_cell):
            units = self.units[tuple(slice(start, None, per_cell) for start in first)]
            known = units != UNKNOWN
            total += np.where(known, units, 0)
            count += known
        means: np.ndarray = np.where(count > 0, np.rint(total / np.maximum(count, 1)), UNKNOWN).astype(np.int16)
        return means

    def cell_means(self) -> np.ndarray:
        """Mean intensity of each cell (K, J, I), float32, as exact as `cell_units`; NaN where no voxel is finite."""
        units, window = self.cell_units(), self._window
        means = units * np.float32(window.width / UNITS_PER_WINDOW) + np.float32(0.5 * (window.low + window.high))
        known: np.ndarray = np.where(units == UNKNOWN, np.float32(np.nan), means)
        return known


def block_means(array: np.ndarray, blocks: tuple[int, int, int]) -> np.ndarray:
    """Mean intensity of each block, float32; NaN where no voxel of a block is finite.

    Args:
        array: (K, J, I), any real dtype; voxels that are not finite are passed over.
        blocks: how many along (K, J, I); neighbours share a voxel where their borders cut it.
    """
    count, rows, columns = blocks
    means = np.empty(blocks, dtype=np.float32)
    for index in range(count):
        # A few slices at a time, so that no copy of the volume is made.
        slices = array[index * len(array) // count : -(-(index + 1) * len(array) // count)].astype(np.float32)
        finite = np.isfinite(slices)
        # Of the largest number that there is, which stands in some scans for what was not measured, sums are infinite.
        with np.errstate(over="ignore"):
            if finite.all():
                # The same as below, in half of the time.
                means[index] = _pooled(slices.sum(axis=0)[None], rows, columns)[0] / np.float32(len(slices))
                continue
            sums = np.stack([np.where(finite, slices, 0.0).sum(axis=0), finite.sum(axis=0, dtype=np.float32)])
            total, known = _pooled(sums, rows, columns)
            means[index] = np.where(known > 0.0, total / np.maximum(known, np.float32(1e-6)), np.nan)
    return means


def _pooled(images: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Means of blocks of images, (N, J, I) float32 to (N, rows, columns)."""
    import torch.nn.functional as F

    return array_of(F.adaptive_avg_pool2d(tensor_of(images), (rows, columns)))


def _in_units(means: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """Mean intensities, NaN where there is none, in `UNITS_PER_WINDOW` from the middle of the window, int16."""
    with np.errstate(over="ignore"):
        units = (means - np.float32(0.5 * (window.low + window.high))) * np.float32(UNITS_PER_WINDOW / window.width)
    in_range = np.clip(np.rint(units), -_FURTHEST, _FURTHEST)
    whole_numbers: np.ndarray = np.where(np.isnan(units), UNKNOWN, in_range).astype(np.int16)
    return whole_numbers


@cache
def _steps_within(radius: float) -> np.ndarray:
    """Steps along K, J, I, (N, 3), no longer than a radius."""
    reach = int(radius)
    steps = np.indices((2 * reach + 1,) * 3).reshape(3, -1).T - reach
    near: np.ndarray = steps[np.linalg.norm(steps, axis=1) <= radius]
    return near
