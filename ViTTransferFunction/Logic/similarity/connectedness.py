"""Fuzzy connectedness: how nearly a place is joined to a point by intensities like the point's own.

D_p(x) is the smallest tolerance t for which x lies in the connected component of p in {x : |u_x − u_p| ≤ t}, where u are
intensities averaged over blocks of half a feature cell, in widths of the display window. It stays small along a vessel however
long, and is large beyond a wall, however like the vessel it looks there. As a similarity,

    C_p(x) = exp(−D_p(x)² / 2σ²).

(Udupa, Samarasekera: Fuzzy Connectedness and Object Definition, 1996.)
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ..core.volumes.geometry import Geometry
from ..core.volumes.intensity_window import IntensityWindow
from ..core.volumes.torch_arrays import array_of, tensor_of
from ..core.volumes.volume import Volume
from .block_cubes import BlockCubes
from .flood_fill import FloodFill

SIGMA = 0.05
"""σ: 20 HU in a window of 400."""
TOLERANCES = np.geomspace(0.4 * SIGMA, 2.2 * SIGMA, 5).astype(np.float32)
"""At which D is found out. Below the first, noise decides; beyond the last, C is next to nothing."""
SIMILARITIES = np.append(np.exp(-0.5 * (TOLERANCES / SIGMA) ** 2), 0.0).astype(np.float32)
"""C where D is each of the tolerances, and where it is larger than all."""
BLOCKS_PER_CELL = 2
"""Along each axis: a wall between two structures is thinner than a cell."""
UNITS_PER_WINDOW = 1024
"""Intensities are compared as 16-bit numbers, which takes a fifth of the time: in these units, the first tolerance is 20."""
_FURTHEST, _UNKNOWN = 10_000, 20_000
"""What lies more than ten windows from the middle of the window counts as that far; and what stands for blocks without a finite
voxel, which is far from all others. No difference leaves 16 bits."""
RIM_UNLIKE = 0.5
RIM_CELLS = 1.5
"""A later positive point that is unlike all before it by more than so many windows may lie at a rim, if something like one of
them is no more than so many cells away. Chosen while looking at one nodule in a lung; see `Benchmarks/results/candidates.md`,
*Positive points at rims*."""
MOST_BLOCKS = 2_200_000
"""Where there would be more, each cell is one block: a new point takes time in proportion to them."""


class Connectedness:
    """Of all cells of a volume with points, one after the other.

    Args:
        volume: the intensities; blocks without a finite voxel are joined to nothing.
        cells: the feature cells, which fill the volume's box.
        window: in which a person would look at them (`display_window`).
        blocks_per_cell: along each axis; one, where that would be too many blocks.
    """

    def __init__(
        self, volume: Volume, cells: Geometry, window: IntensityWindow, blocks_per_cell: int = BLOCKS_PER_CELL
    ) -> None:
        fits = int(np.prod(cells.shape)) * blocks_per_cell**3 <= MOST_BLOCKS
        self._per_cell = blocks_per_cell if fits else 1
        k, j, i = (self._per_cell * count for count in cells.shape)
        self._blocks = _in_units(block_means(volume.array, (k, j, i)), window)
        self._flooded = FloodedBlocks(self._blocks, self._per_cell)
        self._cells, self._window = cells, window

    def from_point(self, point_ras: np.ndarray) -> np.ndarray:
        """C_p of every cell, as an index to `SIMILARITIES`: a byte each, since it is kept for every point.

        A cell has that of its best joined block: one that a vessel crosses belongs to it.

        Args:
            point_ras: (3,) RAS millimetres; outside of the volume, the nearest block counts.

        Returns:
            (cells,) uint8.
        """
        (block,) = self._cells.nearest_voxels(point_ras[None], self._per_cell)
        return self._flooded.tolerances_too_small(block, TOLERANCES).ravel()

    def positives_seen_at(self, positive_ras: np.ndarray) -> np.ndarray:
        """Where a class's positive points are best looked at: there, or in the structure beside it.

        People draw a structure's edge where a voxel may be as dark as what is around, as at that of a nodule in a lung; a later
        point there would have all that is around looked for. So where it is quite unlike all before it, and what is beside it
        no more alike than what is beside these, it is looked at at the nearest block that is like one of them. Where none is
        near, it lies in another part of the structure.

        Args:
            positive_ras: (P, 3) RAS millimetres, in the order placed; outside of the volume, the nearest block counts.

        Returns:
            (P, 3) RAS millimetres; the same array where all points are looked at where they are.
        """
        blocks = self._cells.nearest_voxels(positive_ras, self._per_cell)
        units = self._units_of(blocks)
        places = positive_ras
        for point in range(1, len(blocks)):
            before = units[:point]
            if units[point] == _UNKNOWN or np.abs(before - units[point]).min() <= RIM_UNLIKE * UNITS_PER_WINDOW:
                continue
            *alike_before, alike = self._share_alike(blocks[: point + 1])
            nearest = self._nearest_like(blocks[point], before) if alike <= max(alike_before) else None
            if nearest is not None:
                units[point] = self._units_of(nearest)
                places = np.concatenate([places[:point], self._centres_ras(nearest[None]), places[point + 1 :]])
        return places

    def _nearest_like(self, block: np.ndarray, units: np.ndarray) -> np.ndarray | None:
        """The block nearest to one (3,), within `RIM_CELLS`, that has one of some intensities (N,); None where there is none.

        Of several that are as near, it is the one that is most like them, in whatever order the volume is stored.
        """
        around = self._blocks_within(block, RIM_CELLS * self._per_cell)
        around = around[self._units_of(around) != _UNKNOWN]
        unlike = np.abs(self._units_of(around)[:, None] - units).min(axis=1)
        like = unlike <= SIGMA * UNITS_PER_WINDOW
        steps = ((around[like] - block) ** 2).sum(axis=1)
        return around[like][np.lexsort((unlike[like], steps))[0]] if like.any() else None

    def _share_alike(self, blocks: np.ndarray) -> np.ndarray:
        """The share of what is known beside each of some blocks (N, 3) that is like it, within half of `RIM_UNLIKE`, (N,)."""
        limit = 0.5 * RIM_UNLIKE * UNITS_PER_WINDOW
        shares = []
        for block, own in zip(blocks, self._units_of(blocks), strict=True):
            units = self._units_of(self._blocks_within(block, np.sqrt(3.0)))
            shares.append(np.mean(np.abs(units[units != _UNKNOWN] - own) <= limit) if own != _UNKNOWN else 0.0)
        return np.array(shares)

    def _blocks_within(self, block: np.ndarray, radius: float) -> np.ndarray:
        """The blocks (N, 3) no farther than so many blocks from one of them, (3,): itself as well."""
        blocks = block + _steps_within(radius)
        inside: np.ndarray = blocks[((blocks >= 0) & (blocks < self._blocks.shape)).all(axis=1)]
        return inside

    def negatives_seen_at(self, negative_ras: np.ndarray, positive_ras: np.ndarray) -> np.ndarray:
        """Where a class's negative points are best looked at: there, or at the block that is typical of their cell.

        At a structure's rim a voxel off it may be as bright as the structure, and a cell is wider than the rim: features,
        intensity and connectedness there are those of the structure, and learned as something else they would take it away.
        Where the typical block is less like the positive points than the point's own, by more than σ, it shows what is meant.

        Args:
            negative_ras: (M, 3) RAS millimetres; outside of the volume, the nearest block counts.
            positive_ras: (P, 3) RAS millimetres, P ≥ 1.

        Returns:
            (M, 3) RAS millimetres, each in the cell of its point.
        """
        if not len(negative_ras):
            return negative_ras
        per_cell = self._per_cell
        own = self._cells.nearest_voxels(negative_ras, per_cell)
        of_cell = (own - own % per_cell)[:, None] + np.indices((per_cell,) * 3).reshape(3, -1).T
        units = self._units_of(of_cell)
        middle = np.abs(units - np.median(units, axis=1, keepdims=True)).argmin(axis=1)
        points = np.arange(len(own))
        typical, typical_units = of_cell[points, middle], units[points, middle]
        wanted = self._units_of(self._cells.nearest_voxels(positive_ras, per_cell))
        unlike, own_unlike = (np.abs(of[:, None] - wanted).min(axis=1) for of in (typical_units, self._units_of(own)))
        moves = (unlike > own_unlike + SIGMA * UNITS_PER_WINDOW) & (typical_units != _UNKNOWN)
        places: np.ndarray = np.where(moves[:, None], self._centres_ras(typical), negative_ras)
        return places

    def _centres_ras(self, blocks: np.ndarray) -> np.ndarray:
        """Centres (N, 3), RAS millimetres, of blocks given by their index along K, J, I, (N, 3)."""
        return self._cells.ijk_to_ras_points(((blocks + 0.5) / self._per_cell - 0.5)[:, ::-1])

    def _units_of(self, blocks: np.ndarray) -> np.ndarray:
        """Intensities of blocks given by their index along K, J, I, (…, 3) → (…), float64 in `UNITS_PER_WINDOW`."""
        units: np.ndarray = self._blocks[blocks[..., 0], blocks[..., 1], blocks[..., 2]].astype(float)
        return units

    def cell_units(self) -> np.ndarray:
        """Mean intensity of each cell (K, J, I), int16 in `UNITS_PER_WINDOW`, as `FloodedBlocks` takes them."""
        per_cell = self._per_cell
        total, count = np.zeros((2, *self._cells.shape), dtype=np.int32)
        # One block of every cell after the other: six times as fast as sums along three of six axes.
        for first in np.ndindex(per_cell, per_cell, per_cell):
            units = self._blocks[tuple(slice(start, None, per_cell) for start in first)]
            known = units != _UNKNOWN
            total += np.where(known, units, 0)
            count += known
        means: np.ndarray = np.where(count > 0, np.rint(total / np.maximum(count, 1)), _UNKNOWN).astype(np.int16)
        return means

    def cell_means(self) -> np.ndarray:
        """Mean intensity of each cell (K, J, I), float32, as exact as `cell_units`; NaN where no voxel is finite."""
        units, window = self.cell_units(), self._window
        means = units * np.float32(window.width / UNITS_PER_WINDOW) + np.float32(0.5 * (window.low + window.high))
        known: np.ndarray = np.where(units == _UNKNOWN, np.float32(np.nan), means)
        return known


class FloodedBlocks:
    """The blocks of a volume, to find out what intensities like a block's own join to it.

    Args:
        units: intensities of all blocks (K, J, I), int16, in `UNITS_PER_WINDOW`.
        blocks_per_cell: along each axis; a cell is joined where one of its blocks is.
    """

    def __init__(self, units: np.ndarray, blocks_per_cell: int = 1) -> None:
        k, j, i = units.shape
        self._units, self._per_cell = units, blocks_per_cell
        self._cubes = BlockCubes((k, j, i))
        self._in_cubes = self._cubes.arranged(units, _UNKNOWN)

    def tolerances_too_small(self, block: np.ndarray, tolerances: np.ndarray) -> np.ndarray:
        """How many tolerances are too small to join each cell to a block by intensities, (K, J, I) of the cells uint8.

        Args:
            block: which block, (3,) its index along K, J, I.
            tolerances: from small to large, in widths of the window, less than ten.
        """
        k, j, i = block.tolist()
        difference = self._differences_from((k, j, i))
        flood = FloodFill(self._cubes, (k, j, i))
        too_small = np.full(len(difference), len(tolerances), dtype=np.uint8)
        for tolerance in tolerances:
            flood.through(difference <= np.int16(UNITS_PER_WINDOW * tolerance))
            too_small -= flood.reached(self._per_cell)
        return self._cubes.restored(too_small, self._per_cell)

    def _differences_from(self, block: tuple[int, int, int]) -> np.ndarray:
        """How far the intensities of all blocks are from that around one of them, int16, arranged in cubes."""
        around = self._units[tuple(slice(max(index - 1, 0), index + 2) for index in block)]
        known = around[around != _UNKNOWN]
        difference: np.ndarray = self._in_cubes - np.int16(np.median(known) if known.size else 0)
        np.abs(difference, out=difference)
        # The clicked block belongs to itself, be it brighter than those around it.
        difference[self._cubes.place(block)] = 0
        return difference


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
    units = (means - np.float32(0.5 * (window.low + window.high))) * np.float32(UNITS_PER_WINDOW / window.width)
    in_range = np.clip(np.rint(units), -_FURTHEST, _FURTHEST)
    whole_numbers: np.ndarray = np.where(np.isnan(units), _UNKNOWN, in_range).astype(np.int16)
    return whole_numbers


@cache
def _steps_within(radius: float) -> np.ndarray:
    """Steps along K, J, I, (N, 3), no longer than a radius."""
    reach = int(radius)
    steps = np.indices((2 * reach + 1,) * 3).reshape(3, -1).T - reach
    near: np.ndarray = steps[np.linalg.norm(steps, axis=1) <= radius]
    return near
