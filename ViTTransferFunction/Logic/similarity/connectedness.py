"""Fuzzy connectedness: how nearly a place is joined to a point by intensities like the point's own.

D_p(x) is the smallest tolerance t for which x lies in the connected component of p in {x : |u_x − u_p| ≤ t}, where u are
intensities averaged over blocks of half a feature cell, in widths of the display window. It stays small along a vessel however
long, and is large beyond a wall, however like the vessel it looks there. As a similarity,

    C_p(x) = exp(−D_p(x)² / 2σ²).

(Udupa, Samarasekera: Fuzzy Connectedness and Object Definition, 1996.)
"""

from __future__ import annotations

import numpy as np

from .block_cubes import BlockCubes
from .flood_fill import FloodFill
from .intensity_blocks import UNITS_PER_WINDOW, UNKNOWN, IntensityBlocks

SIGMA = 0.05
"""σ: 20 HU in a window of 400."""
TOLERANCES = np.geomspace(0.4 * SIGMA, 2.2 * SIGMA, 5).astype(np.float32)
"""At which D is found out. Below the first, which is 20 of the blocks' units, noise decides; beyond the last, C is next to
nothing."""
SIMILARITIES = np.append(np.exp(-0.5 * (TOLERANCES / SIGMA) ** 2), 0.0).astype(np.float32)
"""C where D is each of the tolerances, and where it is larger than all."""


class Connectedness:
    """Of all cells of a volume with points, one after the other.

    Args:
        blocks: the volume's; those without a finite voxel are joined to nothing.
    """

    def __init__(self, blocks: IntensityBlocks) -> None:
        self._blocks = blocks
        self._flooded = FloodedBlocks(blocks.units, blocks.per_cell)

    def from_point(self, point_ras: np.ndarray) -> np.ndarray:
        """C_p of every cell, as an index to `SIMILARITIES`: a byte each, since it is kept for every point.

        A cell has that of its best joined block: one that a vessel crosses belongs to it.

        Args:
            point_ras: (3,) RAS millimetres; outside of the volume, the nearest block counts.

        Returns:
            (cells,) uint8.
        """
        (block,) = self._blocks.nearest(point_ras[None])
        return self._flooded.tolerances_too_small(block, TOLERANCES).ravel()


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
        self._in_cubes = self._cubes.arranged(units, UNKNOWN)

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
        known = around[around != UNKNOWN]
        difference: np.ndarray = self._in_cubes - np.int16(np.median(known) if known.size else 0)
        np.abs(difference, out=difference)
        # The clicked block belongs to itself, be it brighter than those around it.
        difference[self._cubes.place(block)] = 0
        return difference
