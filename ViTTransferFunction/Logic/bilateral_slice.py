"""Slicing the bilateral grid: what voxels read from its cells."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from .window_sums import window_sums

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import torch
    from torch import Tensor

    from .bilateral_grid import GridLayout, VoxelCells
    from .workers import Workers

BAND_NUMBERS = 2**19
"""Two megabytes: what is interpolated for a band of rows stays near the processor."""


def slice_nearest(voxel_cells: VoxelCells, numbers: Tensor, values: Tensor, out: Tensor, workers: Workers) -> None:
    """Give every voxel the value of its own cell.

    Args:
        voxel_cells: which cells voxels lie in.
        numbers: (layers + 2, layer size), of the cells.
        values: (cells,) float32.
        out: (K, J, I) float32, written where voxels take part, left as it is elsewhere.
        workers: to share out the layers.
    """
    import torch

    padded = _with_absent_cell(values)

    def slice_layers(layers: Sequence[tuple[int, slice]]) -> None:
        for layer, slices in layers:
            keys, part = voxel_cells.keys(layer, slices)
            within_layer = padded.index_select(0, numbers[layer + 1])
            if part is None and out.is_contiguous():
                torch.index_select(within_layer, 0, keys.view(-1), out=out[slices].view(-1))
            else:
                _assign(out[slices], within_layer.index_select(0, keys.view(-1)).view(keys.shape), part)

    workers.share_out(voxel_cells.layout.layers(), slice_layers)


def slice_multilinear(voxel_cells: VoxelCells, numbers: Tensor, values: Tensor, out: Tensor, workers: Workers) -> None:
    """Give every voxel the multilinear interpolation of the 16 cells around it.

    Of these, the ones that are not occupied take the mean of the occupied ones among the 80 cells around them. Cells are
    interpolated along K for a slice, then along J for a few of its rows at a time, which stay in the processor's cache;
    `grid_sample` interpolates I and luma at each voxel. Voxels beyond the outermost cells' centres lie at the centres.

    Args: as for `slice_nearest`.
    """
    import torch
    from torch.nn.functional import grid_sample

    layout = voxel_cells.layout
    edge_k, edge_j, edge_i = layout.cell_voxels
    value_and_one = _with_absent_cell(values), _with_absent_cell(torch.ones_like(values))
    slice_weights = _weights_between_centres(edge_k).tolist()
    row_weights = _weights_between_centres(edge_j).to(out.device)[:, None, None]
    bands = list(_bands(layout, out.device))
    # grid_sample's coordinates: (luma, I), where -1 and 1 are the first and the last cell of the padded row.
    columns, lumas = layout.layer_shape[1:]
    along_columns = (torch.arange(layout.voxels[2], device=out.device) - 0.5 * (edge_i - 1)) / edge_i
    along_columns = along_columns.clamp_(0, layout.cells[2] - 1) * (2.0 / (columns - 1)) - 1.0

    def slice_layers(layers: Sequence[tuple[int, slice]]) -> None:
        cells_of_layer = _extended_layers(layout, numbers, value_and_one)
        places = torch.empty(max(band.voxel_rows for band in bands), 1, layout.voxels[2], 2, device=out.device)
        places[..., 1] = along_columns
        for layer, slices in layers:
            part = voxel_cells.taking_part(layer, slices)
            for k, band in itertools.product(range(slices.start, slices.stop), bands):
                part_of_band = None if part is None else part[k - slices.start, band.rows]
                if part_of_band is not None and not bool(part_of_band.any()):
                    continue
                below, after_centre = divmod(k - edge_k // 2, edge_k)
                lower, upper = cells_of_layer(below)[band.cells], cells_of_layer(below + 1)[band.cells]
                cells = torch.lerp(lower, upper, slice_weights[after_centre])
                by_row = torch.lerp(cells[:-1, None], cells[1:, None], row_weights).flatten(0, 1)[band.rows_between_cells]
                places_of_band = places[: band.voxel_rows]
                voxel_cells.luma_coordinates((k, band.rows), -1.0, 2.0 / (lumas - 1), out=places_of_band[:, 0, :, 0])
                sampled = grid_sample(by_row[:, None], places_of_band, padding_mode="border", align_corners=True)
                _assign(out[k, band.rows], sampled[:, 0, 0], part_of_band)

    workers.share_out(layout.layers(), slice_layers)


class _Band(NamedTuple):
    """Some neighbouring rows of voxels, and the rows of cells that they lie between."""

    rows: slice
    cells: slice
    rows_between_cells: slice

    @property
    def voxel_rows(self) -> int:
        return self.rows.stop - self.rows.start


def _bands(layout: GridLayout, device: torch.device) -> Iterator[_Band]:
    """Bands of rows that make up a slice."""
    edge = layout.cell_voxels[1]
    # Where the band between two rows of cells begins, the first row of cells being there twice.
    first = edge // 2 - edge
    intervals = layout.cells[1] + 1
    step = intervals
    if device.type == "cpu":
        step = max(1, BAND_NUMBERS // (edge * layout.layer_shape[1] * layout.layer_shape[2]))
    for start in range(0, intervals, step):
        stop = min(start + step, intervals)
        begin, end = start * edge + first, min(stop * edge + first, layout.voxels[1])
        if end > max(begin, 0):
            yield _Band(slice(max(begin, 0), end), slice(start, stop + 1), slice(max(-begin, 0), end - begin))


def _extended_layers(layout: GridLayout, numbers: Tensor, value_and_one: tuple[Tensor, Tensor]) -> Callable[[int], Tensor]:
    """A function from a layer to its cells, (1 + J + 1, I, luma): occupied ones, and beside these the means of them.

    The outermost layers and rows are there twice, for voxels beyond their centres.
    """
    import torch

    rows = layout.cells[1]

    @lru_cache(maxsize=2)
    def own(layer: int) -> Tensor:
        """(2, J, I, luma): value, and 1 where the cell is occupied."""
        sums = torch.empty(2, *layout.layer_shape, device=numbers.device)
        for addend, sum_of_cells in zip(value_and_one, sums, strict=True):
            torch.index_select(addend, 0, numbers[layer + 1], out=sum_of_cells.view(-1))
        return sums

    @lru_cache(maxsize=3)
    def around_within(layer: int) -> Tensor:
        """(2, J, I, luma): sums over each cell and the 26 around it in its layer."""
        return window_sums(own(layer), 1)

    @lru_cache(maxsize=2)
    def extended(layer: int) -> Tensor:
        layer = min(max(layer, 0), layout.cells[0] - 1)
        total, count = around_within(layer - 1) + around_within(layer) + around_within(layer + 1)
        value, occupied = own(layer)
        cells = torch.empty(1 + rows + 1, *layout.layer_shape[1:], device=numbers.device)
        mean = total.div_(count.clamp_(min=1.0))
        torch.where(occupied[:rows] > 0, value[:rows], mean[:rows], out=cells[1:-1])
        cells[0], cells[-1] = cells[1], cells[-2]
        return cells

    return extended


def _with_absent_cell(values: Tensor) -> Tensor:
    """`values` (…, cells), followed by the 0 that places of the dense grid which are not occupied read."""
    from torch.nn.functional import pad

    return pad(values, (0, 1))


def _weights_between_centres(edge: int) -> Tensor:
    """(edge,): weight of the next cell for each voxel from a cell's centre to before the next one's."""
    import torch

    return (torch.arange(edge) + edge // 2 - 0.5 * (edge - 1)) / edge


def _assign(out: Tensor, values: Tensor, where: Tensor | None) -> None:
    """Overwrite `out` with `values`, where told."""
    import torch

    out.copy_(values if where is None else torch.where(where, values, out))
