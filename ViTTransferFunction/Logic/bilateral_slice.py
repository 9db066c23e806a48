"""Slicing the bilateral grid: what voxels read from its cells."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

    from .bilateral_grid import BilateralGrid


def slice_nearest(grid: BilateralGrid, values: Tensor, out: Tensor) -> None:
    """Give every voxel the value of its own cell.

    Args:
        grid: the cells.
        values: (cells,) float32.
        out: (K, J, I) float32, written where voxels take part, left as it is elsewhere.
    """
    import torch

    padded = _with_absent_cell(values)
    for layer, slices in grid.voxel_cells.layout.layers():
        keys, part = grid.voxel_cells.keys(layer, slices)
        within_layer = padded.index_select(0, grid.numbers[layer + 1])
        if part is None and out.is_contiguous():
            torch.index_select(within_layer, 0, keys.view(-1), out=out[slices].view(-1))
        else:
            _assign(out[slices], within_layer.index_select(0, keys.view(-1)).view(keys.shape), part)


def slice_multilinear(grid: BilateralGrid, values: Tensor, out: Tensor) -> None:
    """Give every voxel the multilinear interpolation of the 16 cells around it.

    Of these, the ones that are not occupied take the mean of the occupied ones among the 80 cells around them. Cells are
    interpolated along K for a slice, then along J for its rows; `grid_sample` interpolates I and luma at each voxel. Voxels
    beyond the outermost cells' centres lie at the centres.

    Args: as for `slice_nearest`.
    """
    import torch
    from torch.nn.functional import grid_sample

    layout = grid.voxel_cells.layout
    edge_k, edge_j, edge_i = layout.cell_voxels
    _, columns, lumas = layout.layer_shape
    cells_of_layer = _extended_layers(grid, values)
    slice_weights = _weights_between_centres(edge_k).tolist()
    row_weights = _weights_between_centres(edge_j).to(out.device)[:, None, None]
    rows = slice(edge_j - edge_j // 2, edge_j - edge_j // 2 + layout.voxels[1])
    # grid_sample's coordinates: (luma, I), where -1 and 1 are the first and the last cell of the padded row.
    places = torch.empty(layout.voxels[1], 1, layout.voxels[2], 2, device=out.device)
    along_columns = (torch.arange(layout.voxels[2], device=out.device) - 0.5 * (edge_i - 1)) / edge_i
    places[..., 1] = along_columns.clamp_(0, layout.cells[2] - 1) * (2.0 / (columns - 1)) - 1.0
    for layer, slices in layout.layers():
        part = grid.voxel_cells.taking_part(layer, slices)
        for k in range(slices.start, slices.stop):
            below, after_centre = divmod(k - edge_k // 2, edge_k)
            cells = torch.lerp(cells_of_layer(below), cells_of_layer(below + 1), slice_weights[after_centre])
            by_row = torch.lerp(cells[:-1, None], cells[1:, None], row_weights).flatten(0, 1)[rows]
            grid.voxel_cells.luma_coordinates(k, -1.0, 2.0 / (lumas - 1), out=places[:, 0, :, 0])
            sampled = grid_sample(by_row[:, None], places, mode="bilinear", padding_mode="border", align_corners=True)
            _assign(out[k], sampled[:, 0, 0], None if part is None else part[k - slices.start])


def _extended_layers(grid: BilateralGrid, values: Tensor) -> Callable[[int], Tensor]:
    """A function from a layer to its cells, (1 + J + 1, I, luma): occupied ones, and beside these the means of them.

    The outermost layers and rows are there twice, for voxels beyond their centres.
    """
    import torch

    layout = grid.voxel_cells.layout
    addends = _with_absent_cell(values), _with_absent_cell(torch.ones_like(values))

    def own(layer: int) -> Tensor:
        """(2, J, I, luma): value, and whether the cell is occupied."""
        return torch.stack([addend.index_select(0, grid.numbers[layer + 1]).view(layout.layer_shape) for addend in addends])

    @lru_cache(maxsize=3)
    def around_within(layer: int) -> Tensor:
        """(2, J, I, luma): sums over each cell and the 26 around it in its layer."""
        sums = own(layer)
        for axis in (1, 2, 3):
            first, last = sums.narrow(axis, 0, sums.shape[axis] - 1), sums.narrow(axis, 1, sums.shape[axis] - 1)
            sums = sums.clone()
            sums.narrow(axis, 1, sums.shape[axis] - 1).add_(first)
            sums.narrow(axis, 0, sums.shape[axis] - 1).add_(last)
        return sums

    @lru_cache(maxsize=2)
    def extended(layer: int) -> Tensor:
        layer = min(max(layer, 0), layout.cells[0] - 1)
        value, occupied = own(layer)
        total, count = around_within(layer - 1) + around_within(layer) + around_within(layer + 1)
        cells = torch.where(occupied > 0, value, total / count.clamp_(min=1.0))[: layout.cells[1]]
        return torch.cat([cells[:1], cells, cells[-1:]])

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
