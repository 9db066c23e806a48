"""The bilateral grid: voxels that are near each other in space and in intensity share one cell, and become one unknown.

A 4D grid over (K, J, I, luma). Spatial cells are whole numbers of voxels; luma cells are centred on the multiples of
`sigma_luma`, in units of the intensity window. Only occupied cells are kept. They are found without sorting or hashing: a
voxel's place in the dense grid is arithmetic, and the dense grid, although mostly empty, is small beside the volume.

The grid is walked in layers, all cells with the same K: what a layer needs stays in the processor's cache, and no temporary has
the volume's size. Unoccupied cells pad every row, column and layer, so that neighbours are found without looking for
borders; voxels that take no part are counted into padding.

Cells are coloured red and black like a chessboard: every neighbour of a red cell is black, and the other way round. The padding
makes every stride odd, so that a cell's colour is the parity of its place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from . import large_arrays
from .errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from torch import Tensor

    from .workers import Workers

    ReadSlices = Callable[[slice], Tensor]
    """From slices along K to the target there, (slices, J, I)."""

DIMENSIONS = 4
CHUNK_CELLS = 2**17
"""Cells whose neighbours are visited at a time: what is read for all eight of them stays in the processor's cache."""
MAX_DENSE_CELLS = 2**27
"""Bounds the dense grid: half a gigabyte for each number that a cell holds. A 600³ volume in cells of 5 voxels fits twice."""


@dataclass(frozen=True)
class GridLayout:
    """How many cells there are, and which voxels lie in which: integers only.

    Attributes:
        voxels: volume shape, (K, J, I).
        cell_voxels: voxels along each edge of a spatial cell, (K, J, I).
        luma_cells: cells along luma.
    """

    voxels: tuple[int, int, int]
    cell_voxels: tuple[int, int, int]
    luma_cells: int

    @classmethod
    def of_sigmas(
        cls, voxels: tuple[int, int, int], spacing_mm: tuple[float, float, float], sigma_spatial_mm: float, sigma_luma: float
    ) -> GridLayout:
        """The layout whose cells come nearest to `sigma_spatial_mm` along every axis, and measure `sigma_luma` of the window.

        Raises:
            InputError: the grid would be too large to hold.
        """
        # Larger than the volume is as large as the volume; said here so that an infinite ratio needs no case of its own.
        edges = [max(1, round(min(sigma_spatial_mm / s, n))) for s, n in zip(spacing_mm, voxels, strict=True)]
        layout = cls(voxels, (edges[0], edges[1], edges[2]), math.floor(min(1.0 / sigma_luma, 2.0**31) + 0.5) + 1)
        if layout.dense_cells > MAX_DENSE_CELLS:
            raise InputError(
                f"sigma_spatial_mm {sigma_spatial_mm:g} and sigma_luma {sigma_luma:g} divide a volume of {voxels} voxels of "
                f"{tuple(float(s) for s in spacing_mm)} mm into {layout.dense_cells:.3g} cells; expected at most "
                f"{MAX_DENSE_CELLS:.3g}. Raise either sigma, or refine a smaller region."
            )
        return layout

    @property
    def cells(self) -> tuple[int, int, int]:
        """Spatial cells along (K, J, I), the last of each row perhaps incomplete."""
        return tuple(-(-n // edge) for n, edge in zip(self.voxels, self.cell_voxels, strict=True))  # type: ignore[return-value]

    @property
    def layer_shape(self) -> tuple[int, int, int]:
        """Cells of a layer along (J, I, luma), padding included: odd numbers."""
        return (self.cells[1] + 1) | 1, (self.cells[2] + 1) | 1, (self.luma_cells + 1) | 1

    @property
    def layer_size(self) -> int:
        """Cells of a layer, padding included. The last is padding along every axis."""
        return math.prod(self.layer_shape)

    @property
    def dense_cells(self) -> int:
        """Cells of the dense grid, with the layers of padding before the first and after the last."""
        return (self.cells[0] + 2) * self.layer_size

    @property
    def strides(self) -> tuple[int, int, int, int]:
        """Distance in the dense grid between neighbours along (K, J, I, luma)."""
        _, columns, rows = self.layer_shape
        return self.layer_size, columns * rows, rows, 1

    def layers(self) -> list[tuple[int, slice]]:
        """Number of each layer of cells, and its voxels along K."""
        edge, end = self.cell_voxels[0], self.voxels[0]
        return [(layer, slice(layer * edge, min((layer + 1) * edge, end))) for layer in range(self.cells[0])]


@dataclass(frozen=True, eq=False)
class VoxelCells:
    """Which cell of the dense grid each voxel lies in.

    Attributes:
        layout: the dense grid.
        intensities: (K, J, I), any real dtype.
        window: the intensities that count as luma 0 and luma 1; those outside are clamped.
        sigma_luma: size of a luma cell.
        all_finite: whether every intensity is; decided once, because the careful way is slow.
        active: (K, J, I) bool over spatial cells: those that take part; None for all.
    """

    layout: GridLayout
    intensities: Tensor
    window: tuple[float, float]
    sigma_luma: float
    all_finite: bool
    active: Tensor | None = None

    def luma_coordinates(
        self, voxels: slice | tuple[int, slice], origin: float, unit: float, out: Tensor | None = None
    ) -> Tensor:
        """float32: where voxels lie along luma, on an axis with luma 0 at `origin` and cells of length `unit`."""
        import torch

        low, high = self.window
        # A window without width tells no intensities apart.
        units_per_intensity = unit / ((high - low) * self.sigma_luma) if high > low else 0.0
        intensities = self.intensities[voxels]
        if not self.all_finite:
            intensities = torch.where(torch.isfinite(intensities), intensities, low)
        at_zero = torch.tensor(origin - low * units_per_intensity, device=intensities.device)
        coordinates = torch.add(at_zero, intensities.to(torch.float32), alpha=units_per_intensity)
        last_cell = min(1.0 / self.sigma_luma, self.layout.luma_cells - 1.0)
        return torch.clamp(coordinates, origin, origin + unit * last_cell, out=coordinates if out is None else out)

    def keys(self, layer: int, slices: slice) -> tuple[Tensor, Tensor | None]:
        """Place of each voxel's cell within its layer, and whether the voxel takes part.

        Returns:
            (slices, J, I) int32, where voxels that take no part are in padding; (slices, J, I) bool, or None where all do.
        """
        import torch

        keys = self.luma_coordinates(slices, origin=0.5, unit=1.0).to(torch.int32).add_(self._column_keys)
        part = self.taking_part(layer, slices)
        return (keys if part is None else torch.where(part, keys, self.layout.layer_size - 1)), part

    def taking_part(self, layer: int, slices: slice) -> Tensor | None:
        """(slices, J, I) bool: whether the voxels of a layer take part; None where all do."""
        import torch

        active = None
        if self.active is not None and not bool(self.active[layer].all()):
            _, edge_j, edge_i = self.layout.cell_voxels
            active = self.active[layer].repeat_interleave(edge_j, 0).repeat_interleave(edge_i, 1)
            active = active[: self.layout.voxels[1], : self.layout.voxels[2]].expand(slices.stop - slices.start, -1, -1)
        if self.all_finite:
            return active
        finite = torch.isfinite(self.intensities[slices])
        return finite if active is None else finite & active

    @cached_property
    def _column_keys(self) -> Tensor:
        """(J, I) int32: the place within a layer of the first of the luma cells that a voxel may lie in."""
        import torch

        rows, columns = (
            torch.arange(n, dtype=torch.int32, device=self.intensities.device) // edge
            for n, edge in zip(self.layout.voxels[1:], self.layout.cell_voxels[1:], strict=True)
        )
        return rows[:, None] * self.layout.strides[1] + columns * self.layout.strides[2]


@dataclass(frozen=True, eq=False)
class OccupiedCells:
    """Cells that hold voxels: what these sum to, and which cells are neighbours.

    They are numbered: red ones first, each colour in the order of the dense grid.

    Attributes:
        mass: (cells,) voxels in each cell.
        confidence: (cells,) sum over each cell's voxels.
        weighted_target: (cells,) sum of confidence × target over each cell's voxels.
        red_cells: how many cells are red.
        neighbours: (8, cells) int32: numbers of each cell's neighbours along the four axes; the number of cells where none is.
    """

    mass: Tensor
    confidence: Tensor
    weighted_target: Tensor
    red_cells: int
    neighbours: Tensor

    def neighbour_sum(self, values: Tensor, cells: slice | None = None) -> Tensor:
        """Sum of `values` (cells + 1,), whose last is the 0 of all cells that do not exist, over the neighbours of `cells`."""
        import torch

        neighbours = self.neighbours if cells is None else self.neighbours[:, cells]
        total = values.new_empty(neighbours.shape[1])
        for chunk in _chunks(len(total)):
            first, *others = neighbours[:, chunk]
            torch.index_select(values, 0, first, out=total[chunk])
            for along in others:
                total[chunk] += values.index_select(0, along)
        return total


def splat(
    voxel_cells: VoxelCells, read_target: ReadSlices, confidence: Tensor | None, workers: Workers
) -> tuple[OccupiedCells, Tensor]:
    """Sum a finite target and its confidence (K, J, I) over cells; without confidence, every voxel counts 1.

    Returns:
        The cells, and (layers + 2, layer size) int32: the number of each cell of the dense grid, or of cells where unoccupied.
    """
    import torch

    sums = _sums_over_cells(voxel_cells, read_target, confidence, workers)
    red, black = _occupied_cells(sums[0])
    keys = torch.cat([red, black])
    mass, weighted_target, *rest = (dense.view(-1).index_select(0, keys) for dense in sums)
    # Memory for what follows.
    del sums
    numbers = _numbered(voxel_cells.layout, keys)
    neighbours = _neighbours(voxel_cells.layout, numbers, keys, workers)
    return OccupiedCells(mass, rest[0] if rest else mass, weighted_target, len(red), neighbours), numbers


def _sums_over_cells(
    voxel_cells: VoxelCells, read_target: ReadSlices, confidence: Tensor | None, workers: Workers
) -> list[Tensor]:
    """Dense sums of 1, confidence × target and, where given, confidence: each (layers + 2, layer size)."""
    import torch

    layout, device = voxel_cells.layout, voxel_cells.intensities.device
    shape = layout.cells[0] + 2, layout.layer_size
    sums = [large_arrays.empty(shape, torch.float32, device).zero_() for _ in range(2 if confidence is None else 3)]
    ones = torch.ones(layout.cell_voxels[0], *layout.voxels[1:], device=device)

    def add_layers(layers: Sequence[tuple[int, slice]]) -> None:
        for layer, slices in layers:
            keys = voxel_cells.keys(layer, slices)[0].view(-1).to(torch.int64)
            target = read_target(slices).to(torch.float32)
            addends = [ones[: len(target)], target]
            if confidence is not None:
                weights = confidence[slices].to(torch.float32)
                addends[1:] = [weights * target, weights]
            for dense, addend in zip(sums, addends, strict=True):
                dense[layer + 1].scatter_add_(0, keys, addend.reshape(-1))

    workers.share_out(layout.layers(), add_layers)
    for dense in sums:
        # What was counted into padding takes no part.
        dense[:, -1] = 0.0
    return sums


def _occupied_cells(mass: Tensor) -> tuple[Tensor, Tensor]:
    """Places in the dense grid of the red and of the black cells that hold a voxel, each ascending."""
    flat = mass.view(-1)
    return _true_places(flat[0::2] > 0).mul_(2), _true_places(flat[1::2] > 0).mul_(2).add_(1)


def _true_places(mask: Tensor) -> Tensor:
    """int64: places of the true elements."""
    import torch

    if mask.device.type == "cpu":
        # The same as below, 6 times faster.
        return torch.from_numpy(np.flatnonzero(mask.numpy()))
    return mask.nonzero()[:, 0]


def _numbered(layout: GridLayout, keys: Tensor) -> Tensor:
    """(layers + 2, layer size) int32: position in `keys` of each cell; `len(keys)` where it is not among them."""
    import torch

    numbers = large_arrays.empty((layout.cells[0] + 2, layout.layer_size), torch.int32, keys.device).fill_(len(keys))
    numbers.view(-1).scatter_(0, keys, torch.arange(len(keys), dtype=torch.int32, device=keys.device))
    return numbers


def _neighbours(layout: GridLayout, numbers: Tensor, keys: Tensor, workers: Workers) -> Tensor:
    """(8, cells) int32: numbers of the cells before and after each along every axis."""
    import torch

    steps = [step for stride in layout.strides for step in (-stride, stride)]
    neighbours = large_arrays.empty((len(steps), len(keys)), torch.int32, keys.device)

    def find(chunks: Sequence[slice]) -> None:
        for chunk in chunks:
            for along, step in zip(neighbours, steps, strict=True):
                torch.index_select(numbers.view(-1), 0, keys[chunk] + step, out=along[chunk])

    workers.share_out(_chunks(len(keys)), find)
    return neighbours


def _chunks(cells: int) -> list[slice]:
    return [slice(start, min(start + CHUNK_CELLS, cells)) for start in range(0, cells, CHUNK_CELLS)]
