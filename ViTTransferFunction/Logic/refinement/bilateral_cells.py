"""The occupied cells of a bilateral grid: sums over the voxels in each, and their neighbours."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.torch_arrays import array_of, tensor_of
from . import large_arrays
from .bilateral_grid import DIMENSIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from torch import Tensor

    from .bilateral_grid import GridLayout, Piece, VoxelCells
    from .workers import Workers

MAX_PACKED_VOXELS = 2**11
"""Largest number of voxels in a cell for which float64 has enough bits for both their number and the sum of their targets."""


@dataclass(frozen=True, eq=False)
class Target:
    """The map that is refined, all of it finite.

    Attributes:
        read: returns the target in a piece of the volume, (slices, rows, I).
        largest: upper bound of all magnitudes.
    """

    read: Callable[[Piece], Tensor]
    largest: float


@dataclass(frozen=True, eq=False)
class OccupiedCells:
    """The cells that hold voxels, in this order: red before black, then by layer, then by place within the layer.

    Attributes:
        mass: (cells,) number of voxels in each cell.
        confidence: (cells,) sum over each cell's voxels.
        weighted_target: (cells,) sum of confidence × target over each cell's voxels.
        red_cells: number of red cells.
        neighbours: (8, cells) int32, indices of each cell's neighbours along the four axes; for a missing neighbour, the number
            of cells.
    """

    mass: Tensor
    confidence: Tensor
    weighted_target: Tensor
    red_cells: int
    neighbours: Tensor

    def neighbour_sum(self, values: Tensor, cells: slice) -> Tensor:
        """Sum of `values` (cells + 1,) over the neighbours of `cells`; the last value is 0, for missing neighbours."""
        first, *others = self.neighbours[:, cells]
        total = values.index_select(0, first)
        for along in others:
            total += values.index_select(0, along)
        return total


@dataclass(frozen=True, eq=False)
class CellPlaces:
    """Where the occupied cells lie in the dense grid.

    Attributes:
        layout: the dense grid.
        in_grid: (cells,) int32: each cell's place in the dense grid.
        of_layers: for each layer, the range of its red cells and that of its black cells.
    """

    layout: GridLayout
    in_grid: Tensor
    of_layers: Sequence[tuple[slice, slice]]

    def dense(self, layers: slice, values: Tensor, elsewhere: float = 0.0) -> Tensor:
        """(layers · layer size,): `values` (cells,) in occupied cells, and `elsewhere` in all others, also beyond the grid."""
        dense = values.new_full(((layers.stop - layers.start) * self.layout.layer_size,), elsewhere)
        self.put(layers, values, dense)
        return dense

    def put(self, layers: slice, values: Tensor, dense: Tensor) -> None:
        """Write `values` (cells,) to the places of the occupied cells in some dense layers."""
        for cells, places in self.in_layers(layers):
            dense.scatter_(0, places, values[cells])

    def in_layers(self, layers: slice) -> list[tuple[slice, Tensor]]:
        """The ranges of some layers' red and black cells, each with their places from the first of these layers on, int64."""
        import torch

        within = self.of_layers[max(layers.start, 0) : max(layers.stop, 0)]
        if not within:
            return []
        of_colours = [slice(first.start, last.stop) for first, last in zip(within[0], within[-1], strict=True)]
        start = layers.start * self.layout.layer_size
        return [(cells, self.in_grid[cells].to(torch.int64).sub_(start)) for cells in of_colours]


def splat(
    voxel_cells: VoxelCells, target: Target, confidence: Tensor | None, workers: Workers
) -> tuple[OccupiedCells, CellPlaces]:
    """Sum a finite target and its confidence (K, J, I) over cells; without confidence, every voxel has 1."""
    (in_grid, mass, weighted_target, *rest), counts = _occupied(voxel_cells, target, confidence, workers)
    ends = [0, *itertools.accumulate(counts)]
    numbers = [slice(*ends_of_part) for ends_of_part in itertools.pairwise(ends)]
    layers = len(numbers) // 2
    places = CellPlaces(voxel_cells.layout, in_grid, list(zip(numbers[:layers], numbers[layers:], strict=True)))
    neighbours = _neighbours(places, workers)
    return OccupiedCells(mass, rest[0] if rest else mass, weighted_target, ends[layers], neighbours), places


def _occupied(
    voxel_cells: VoxelCells, target: Target, confidence: Tensor | None, workers: Workers
) -> tuple[list[Tensor], list[int]]:
    """Places of the occupied cells and sums over their voxels, (cells,) each; and the number of cells by colour and layer.

    Cells are in the order of `OccupiedCells`. The sums are of 1, of confidence × target and, if given, of confidence.
    """
    import torch

    layout = voxel_cells.layout
    unit = _packing_unit(voxel_cells, target.largest) if confidence is None else None
    runs = layout.runs()
    found: list[list[Tensor]] = [[] for _ in range(2 * len(runs))]
    counts = [0] * (2 * layout.cells[0])

    def sum_runs(shares: Sequence[int]) -> None:
        for run in shares:
            workers.between()
            layers = runs[run]
            if unit is None:
                sums = _separate_sums(voxel_cells, layers, target, confidence)
            else:
                sums = [_packed_sums(voxel_cells, layers, target, unit)]
            for colour in (0, 1):
                places = _places_of_colour(layers.start, colour, sums[0])
                of_cells = [dense.index_select(0, places) for dense in sums]
                if unit is not None:
                    of_cells = _unpacked(of_cells[0], unit)
                of_layers = torch.bincount(places // layout.layer_size, minlength=layers.stop - layers.start)
                first = colour * layout.cells[0]
                counts[first + layers.start : first + layers.stop] = of_layers.tolist()
                in_grid = places.add_(layers.start * layout.layer_size).to(torch.int32)
                found[colour * len(runs) + run] = [in_grid, *of_cells]

    workers.share_out(range(len(runs)), sum_runs)
    return [torch.cat(parts) for parts in zip(*found, strict=True)], counts


def _packing_unit(voxel_cells: VoxelCells, largest_target: float) -> float | None:
    """The unit that counts voxels, if a cell's voxels and their targets are summed in one number; None if they cannot be.

    It is so large that targets never add up to half of it, and float64 still has 28 bits for their sum.
    """
    most_voxels = math.prod(voxel_cells.layout.cell_voxels)
    # Apple's GPUs have no float64.
    if most_voxels > MAX_PACKED_VOXELS or voxel_cells.intensities.device.type == "mps":
        return None
    return 4.0 * most_voxels * largest_target if largest_target > 0.0 else 1.0


def _packed_sums(voxel_cells: VoxelCells, layers: slice, target: Target, unit: float) -> Tensor:
    """(layers · layer size,) float64: for each place, the sum of `unit` + target over the voxels in it."""
    import torch

    layout = voxel_cells.layout
    places = (layers.stop - layers.start) * layout.layer_size
    sums = torch.zeros(places, dtype=torch.float64, device=voxel_cells.intensities.device)
    for piece in voxel_cells.pieces(layout.slices(layers)):
        keys = voxel_cells.keys(piece, voxel_cells.taking_part(piece), layers.start).view(-1).to(torch.int64)
        # One addition to memory for each voxel, instead of two as in `_separate_sums`.
        sums.scatter_add_(0, keys, target.read(piece).reshape(-1).to(torch.float64).add_(unit))
    # Voxels that take no part were added to the padding.
    sums[layout.layer_size - 1] = 0.0
    return sums


def _unpacked(sums: Tensor, unit: float) -> list[Tensor]:
    """The number of voxels of each cell and the sum of their targets, both float32."""
    import torch

    voxels = (sums / unit).round_()
    return [voxels.to(torch.float32), sums.sub_(voxels, alpha=unit).to(torch.float32)]


def _separate_sums(voxel_cells: VoxelCells, layers: slice, target: Target, confidence: Tensor | None) -> list[Tensor]:
    """Like `_packed_sums`, but separate sums of 1, of confidence × target and, if given, of confidence."""
    import torch

    layout, device = voxel_cells.layout, voxel_cells.intensities.device
    places = (layers.stop - layers.start) * layout.layer_size
    sums = [torch.zeros(places, device=device) for _ in range(2 if confidence is None else 3)]
    for piece in voxel_cells.pieces(layout.slices(layers)):
        keys = voxel_cells.keys(piece, voxel_cells.taking_part(piece), layers.start).view(-1).to(torch.int64)
        values = target.read(piece).to(torch.float32)
        addends = [torch.ones_like(values), values]
        if confidence is not None:
            weights = confidence[piece].to(torch.float32)
            addends[1:] = [weights * values, weights]
        for dense, addend in zip(sums, addends, strict=True):
            dense.scatter_add_(0, keys, addend.reshape(-1))
    for dense in sums:
        dense[layout.layer_size - 1] = 0.0
    return sums


def _places_of_colour(first_layer: int, colour: int, mass: Tensor) -> Tensor:
    """Places, from a layer on, of the occupied cells that are red (0) or black (1); int64, ascending."""
    # Layers have an odd size, so that colours alternate from one layer to the next as well.
    first = (first_layer + colour) % 2
    of_colour = mass[first::2]
    if mass.device.type == "cpu":
        # The same as below, several times faster.
        places = tensor_of(np.flatnonzero(array_of(of_colour) > 0.0))
    else:
        places = (of_colour > 0.0).nonzero()[:, 0]
    return places.mul_(2).add_(first)


def _neighbours(places: CellPlaces, workers: Workers) -> Tensor:
    """Indices of the cells before and after each cell along every axis, (8, cells) int32."""
    import torch

    layout, device = places.layout, places.in_grid.device
    cells = len(places.in_grid)
    numbers = torch.arange(cells, dtype=torch.int32, device=device)
    neighbours = large_arrays.empty((2 * DIMENSIONS, cells), torch.int32, device)
    steps = [step for stride in (layout.layer_size, *layout.strides) for step in (-stride, stride)]

    def find(runs: Sequence[slice]) -> None:
        for layers in runs:
            workers.between()
            # One more layer on either side; rows and columns end with padding.
            around = places.dense(slice(layers.start - 1, layers.stop + 1), numbers, elsewhere=cells)
            for of_colour, at in places.in_layers(layers):
                for along, step in zip(neighbours, steps, strict=True):
                    torch.index_select(around[layout.layer_size + step :], 0, at, out=along[of_colour])

    workers.share_out(layout.runs(), find)
    return neighbours
