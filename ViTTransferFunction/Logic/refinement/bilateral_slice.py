"""Slicing the bilateral grid: what voxels read from its cells."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import torch
    from torch import Tensor

    from .bilateral_cells import CellPlaces, Target
    from .bilateral_grid import GridLayout, VoxelCells
    from .workers import Workers

BAND_NUMBERS = 2**19
"""Two megabytes: what is interpolated for a band of rows stays near the processor."""


def slice_multilinear(
    voxel_cells: VoxelCells, places: CellPlaces, values: Tensor, target: Target, out: Tensor, workers: Workers
) -> None:
    """Give every voxel the multilinear interpolation of the 16 cells around it.

    Of these, the ones that are not occupied take the mean of the occupied ones among the 80 cells around them. Cells are
    interpolated along K for a slice, then along J for a few of its rows at a time, which stay in the processor's cache;
    `grid_sample` interpolates I and luma at each voxel. Voxels beyond the outermost cells' centres lie at the centres.

    Args:
        voxel_cells: which cells voxels lie in.
        places: where the cells lie.
        values: (cells,) float32.
        target: what voxels that take no part keep.
        out: (K, J, I) float32, which is written.
        workers: to share out the layers.
    """
    import torch
    from torch.nn.functional import grid_sample

    layout = voxel_cells.layout
    edge_k, edge_j, edge_i = layout.cell_voxels
    slice_weights = _weights_between_centres(edge_k).tolist()
    row_weights = _weights_between_centres(edge_j).to(out.device)[:, None, None]
    bands = list(_bands(layout, out.device))
    # grid_sample's coordinates: -1 and 1 are the first and the last cell of the padded row.
    columns, lumas = layout.layer_shape[1:]
    before_k, _, before_i = layout.before
    along_columns = (torch.arange(before_i, before_i + layout.voxels[2], device=out.device) - 0.5 * (edge_i - 1)) / edge_i
    along_columns = along_columns.clamp_(0, layout.cells[2] - 1) * (2.0 / (columns - 1)) - 1.0

    def slice_layers(layers: Sequence[tuple[int, slice]]) -> None:
        cells_of_layer = _extended_layers(places, values)
        # (luma and I, rows, I): each in one piece, as `grid_sample` reads them fastest.
        coordinates = torch.empty(2, max(band.voxel_rows for band in bands), layout.voxels[2], device=out.device)
        coordinates[1] = along_columns
        for _, slices in layers:
            for k, band in itertools.product(range(slices.start, slices.stop), bands):
                workers.between()
                piece = slice(k, k + 1), band.rows
                part = voxel_cells.taking_part(piece)
                if part is not None and not bool(part.any()):
                    out[piece] = target.read(piece)
                    continue
                below, after_centre = divmod(k + before_k - edge_k // 2, edge_k)
                lower, upper = cells_of_layer(below)[band.cells], cells_of_layer(below + 1)[band.cells]
                cells = torch.lerp(lower, upper, slice_weights[after_centre])
                by_row = torch.lerp(cells[:-1, None], cells[1:, None], row_weights).flatten(0, 1)[band.rows_between_cells]
                at = coordinates[:, : band.voxel_rows]
                voxel_cells.luma_coordinates(piece, part, -1.0, 2.0 / (lumas - 1), out=at[:1])
                at_rows = at.movedim(0, -1)[:, None]
                sampled = grid_sample(by_row[:, None], at_rows, padding_mode="border", align_corners=True)
                of_cells = sampled.view(1, *at.shape[1:])
                out[piece] = of_cells if part is None else torch.where(part, of_cells, target.read(piece))

    workers.share_out(layout.layers(), slice_layers)


class _Band(NamedTuple):
    """Some neighbouring rows of voxels, and the rows of cells that they lie between."""

    rows: slice
    cells: slice
    rows_between_cells: slice

    @property
    def voxel_rows(self) -> int:
        return int(self.rows.stop - self.rows.start)


def _bands(layout: GridLayout, device: torch.device) -> Iterator[_Band]:
    """Bands of rows that make up a slice."""
    edge = layout.cell_voxels[1]
    # Where the band between two rows of cells begins, the first row of cells being there twice.
    first = edge // 2 - edge - layout.before[1]
    intervals = layout.cells[1] + 1
    step = intervals
    if device.type == "cpu":
        step = max(1, BAND_NUMBERS // (edge * layout.layer_shape[1] * layout.layer_shape[2]))
    for start in range(0, intervals, step):
        stop = min(start + step, intervals)
        begin, end = start * edge + first, min(stop * edge + first, layout.voxels[1])
        if end > max(begin, 0):
            yield _Band(slice(max(begin, 0), end), slice(start, stop + 1), slice(max(-begin, 0), end - begin))


def _extended_layers(places: CellPlaces, values: Tensor) -> Callable[[int], Tensor]:
    """A function from a layer to its cells, (1 + J + 1, I, luma): occupied ones, and beside these the means of them.

    The outermost layers and rows are there twice, for voxels beyond their centres.
    """
    import torch

    layout = places.layout
    layers, rows, _ = layout.cells
    # As bytes, which hold the sums of 81.
    ones = torch.ones(len(values), dtype=torch.uint8, device=values.device)

    @lru_cache(maxsize=3)
    def around_within(layer: int) -> tuple[Tensor, Tensor]:
        """(layer size,) each: sum and number of the occupied ones among a cell and the 26 around it in its layer.

        In padding, anything.
        """
        here = slice(layer, layer + 1)
        total, count = places.dense(here, values), places.dense(here, ones)
        for stride in layout.strides:
            total, count = _with_neighbours(total, stride), _with_neighbours(count, stride)
        return total, count

    @lru_cache(maxsize=2)
    def extended(layer: int) -> Tensor:
        layer = min(max(layer, 0), layers - 1)
        before, here, after = (around_within(layer + step) for step in (-1, 0, 1))
        total, count = (a + b + c for a, b, c in zip(before, here, after, strict=True))
        cells = torch.empty(1 + rows + 1, *layout.layer_shape[1:], device=values.device)
        inner = cells[1:-1].view(-1)
        torch.div(total[: len(inner)], count[: len(inner)].clamp_(min=1), out=inner)
        places.put(slice(layer, layer + 1), values, inner)
        cells[0], cells[-1] = cells[1], cells[-2]
        return cells

    return extended


def _with_neighbours(values: Tensor, stride: int) -> Tensor:
    """Each of `values` (layer size,) plus the ones before and after it along an axis of the layer."""
    sums = values.clone()
    sums[stride:] += values[:-stride]
    sums[:-stride] += values[stride:]
    return sums


def _weights_between_centres(edge: int) -> Tensor:
    """(edge,): weight of the next cell for each voxel from a cell's centre to before the next one's."""
    import torch

    return (torch.arange(edge) + edge // 2 - 0.5 * (edge - 1)) / edge
