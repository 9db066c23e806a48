"""The occupied cells of a bilateral grid: what the voxels in them sum to, and which are neighbours of which."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from . import large_arrays
from .bilateral_grid import DIMENSIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from torch import Tensor

    from .bilateral_grid import GridLayout, Piece, VoxelCells
    from .workers import Workers

MAX_PACKED_VOXELS = 2**11
"""In a cell. Beyond, float64 has too few bits for their number and the sum of their targets."""


@dataclass(frozen=True, eq=False)
class Target:
    """The map that is refined, all of it finite.

    Attributes:
        read: from a piece of the volume to the target there, (slices, rows, I).
        largest: no voxel's magnitude is greater.
    """

    read: Callable[[Piece], Tensor]
    largest: float


@dataclass(frozen=True, eq=False)
class OccupiedCells:
    """Cells that hold voxels, numbered: red ones first, each colour by layer, and by place within a layer.

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

    def neighbour_sum(self, values: Tensor, cells: slice) -> Tensor:
        """Sum of `values` (cells + 1,), whose last is the 0 of all cells that do not exist, over the neighbours of `cells`."""
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
        within_layer: (cells,) int32: each cell's place in its layer.
        of_layers: the numbers of each layer's red cells and of its black cells.
    """

    layout: GridLayout
    within_layer: Tensor
    of_layers: Sequence[tuple[slice, slice]]

    def dense_layer(self, layer: int, values: Tensor, elsewhere: float = 0.0) -> Tensor:
        """(layer size,): `values` (cells,) where cells are occupied; in layers beyond the grid, none are."""
        dense = values.new_full((self.layout.layer_size,), elsewhere)
        if 0 <= layer < len(self.of_layers):
            self.put(layer, values, dense)
        return dense

    def put(self, layer: int, values: Tensor, dense: Tensor) -> None:
        """Write `values` (cells,) to where the occupied cells lie in a dense layer."""
        import torch

        for cells in self.of_layers[layer]:
            dense.scatter_(0, self.within_layer[cells].to(torch.int64), values[cells])


def splat(
    voxel_cells: VoxelCells, target: Target, confidence: Tensor | None, workers: Workers
) -> tuple[OccupiedCells, CellPlaces]:
    """Sum a finite target and its confidence (K, J, I) over cells; without confidence, every voxel counts 1."""
    (within_layer, mass, weighted_target, *rest), counts = _occupied(voxel_cells, target, confidence, workers)
    ends = [0, *itertools.accumulate(counts)]
    numbers = [slice(*ends_of_part) for ends_of_part in itertools.pairwise(ends)]
    layers = len(numbers) // 2
    places = CellPlaces(voxel_cells.layout, within_layer, list(zip(numbers[:layers], numbers[layers:], strict=True)))
    neighbours = _neighbours(places, workers)
    return OccupiedCells(mass, rest[0] if rest else mass, weighted_target, ends[layers], neighbours), places


def _occupied(
    voxel_cells: VoxelCells, target: Target, confidence: Tensor | None, workers: Workers
) -> tuple[list[Tensor], list[int]]:
    """Places of the occupied cells in their layers and what their voxels sum to, (cells,) each; cells by colour and layer.

    The sums are of 1, of confidence × target and, where given, of confidence.
    """
    import torch

    layout = voxel_cells.layout
    unit = _packing_unit(voxel_cells, target.largest) if confidence is None else None
    found: list[list[Tensor]] = [[] for _ in range(2 * layout.cells[0])]

    def sum_layers(layers: Sequence[tuple[int, slice]]) -> None:
        for layer, slices in layers:
            workers.between()
            if unit is None:
                sums = _separate_sums(voxel_cells, layer, slices, target, confidence)
            else:
                sums = [_packed_sums(voxel_cells, layer, slices, target, unit)]
            for colour in (0, 1):
                places = _places_of_colour(layer, colour, sums[0])
                of_cells = [dense.index_select(0, places) for dense in sums]
                if unit is not None:
                    of_cells = _unpacked(of_cells[0], unit)
                found[colour * layout.cells[0] + layer] = [places.to(torch.int32), *of_cells]

    workers.share_out(layout.layers(), sum_layers)
    return [torch.cat(parts) for parts in zip(*found, strict=True)], [len(places) for places, *_ in found]


def _packing_unit(voxel_cells: VoxelCells, largest_target: float) -> float | None:
    """What stands for one voxel where a cell's voxels and their targets are summed in the same number; None where they cannot.

    The unit is so large that targets never add up to half of one, and float64 still has 28 bits for their sum.
    """
    most_voxels = math.prod(voxel_cells.layout.cell_voxels)
    # Apple's GPUs have no float64.
    if most_voxels > MAX_PACKED_VOXELS or voxel_cells.intensities.device.type == "mps":
        return None
    return 4.0 * most_voxels * largest_target if largest_target > 0.0 else 1.0


def _packed_sums(voxel_cells: VoxelCells, layer: int, slices: slice, target: Target, unit: float) -> Tensor:
    """(layer size,) float64: sum over the layer's voxels in each place of `unit` + target."""
    import torch

    sums = torch.zeros(voxel_cells.layout.layer_size, dtype=torch.float64, device=voxel_cells.intensities.device)
    for piece in voxel_cells.pieces(slices):
        keys = voxel_cells.keys(piece, voxel_cells.taking_part(layer, piece)).view(-1).to(torch.int64)
        # One addition to memory for each voxel, where `_separate_sums` makes two.
        sums.scatter_add_(0, keys, target.read(piece).reshape(-1).to(torch.float64).add_(unit))
    # What was counted into padding takes no part.
    sums[-1] = 0.0
    return sums


def _unpacked(sums: Tensor, unit: float) -> list[Tensor]:
    """Voxels of each cell, and sum of their targets; float32."""
    import torch

    voxels = (sums / unit).round_()
    return [voxels.to(torch.float32), sums.sub_(voxels, alpha=unit).to(torch.float32)]


def _separate_sums(
    voxel_cells: VoxelCells, layer: int, slices: slice, target: Target, confidence: Tensor | None
) -> list[Tensor]:
    """Sums over the layer's voxels in each place, (layer size,): of 1, confidence × target and, where given, confidence."""
    import torch

    device = voxel_cells.intensities.device
    sums = [torch.zeros(voxel_cells.layout.layer_size, device=device) for _ in range(2 if confidence is None else 3)]
    for piece in voxel_cells.pieces(slices):
        keys = voxel_cells.keys(piece, voxel_cells.taking_part(layer, piece)).view(-1).to(torch.int64)
        values = target.read(piece).to(torch.float32)
        addends = [torch.ones_like(values), values]
        if confidence is not None:
            weights = confidence[piece].to(torch.float32)
            addends[1:] = [weights * values, weights]
        for dense, addend in zip(sums, addends, strict=True):
            dense.scatter_add_(0, keys, addend.reshape(-1))
    for dense in sums:
        dense[-1] = 0.0
    return sums


def _places_of_colour(layer: int, colour: int, mass: Tensor) -> Tensor:
    """int64, ascending: places within a layer of the occupied cells that are red (0) or black (1)."""
    import torch

    first = (layer + colour) % 2
    of_colour = mass[first::2]
    if mass.device.type == "cpu":
        # The same as below, several times faster.
        places = torch.from_numpy(np.flatnonzero(of_colour.numpy() > 0.0))
    else:
        places = (of_colour > 0.0).nonzero()[:, 0]
    return places.mul_(2).add_(first)


def _neighbours(places: CellPlaces, workers: Workers) -> Tensor:
    """(8, cells) int32: numbers of the cells before and after each along every axis."""
    import torch
    from torch.nn.functional import pad

    layout, device = places.layout, places.within_layer.device
    cells = len(places.within_layer)
    numbers = torch.arange(cells, dtype=torch.int32, device=device)
    neighbours = large_arrays.empty((2 * DIMENSIONS, cells), torch.int32, device)
    # Padding before the layer, for the first row.
    before = layout.strides[0]
    steps = [step for stride in layout.strides for step in (-stride, stride)]

    def find(layers: Sequence[tuple[int, slice]]) -> None:
        @lru_cache(maxsize=3)
        def numbers_in(layer: int) -> Tensor:
            return pad(places.dense_layer(layer, numbers, elsewhere=cells), (before, 0), value=cells)

        for layer, _ in layers:
            workers.between()
            tables = [numbers_in(layer - 1)[before:], numbers_in(layer + 1)[before:]]
            tables += [numbers_in(layer)[before + step :] for step in steps]
            for of_colour in places.of_layers[layer]:
                at = places.within_layer[of_colour]
                for along, table in zip(neighbours, tables, strict=True):
                    torch.index_select(table, 0, at, out=along[of_colour])

    workers.share_out(layout.layers(), find)
    return neighbours
