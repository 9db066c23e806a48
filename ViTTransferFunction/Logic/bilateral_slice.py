"""Slicing the bilateral grid: what voxels read from its cells."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from .bilateral_grid import BilateralGrid


def slice_nearest(grid: BilateralGrid, values: Tensor, out: Tensor) -> None:
    """Give every voxel the value of its own cell.

    Args:
        grid: the cells.
        values: (cells,) float32.
        out: (K, J, I) float32, written where voxels take part, left as it is elsewhere.
    """
    padded = _with_absent_cell(values)
    for layer, slices in grid.voxel_cells.layout.layers():
        keys, part = grid.voxel_cells.keys(layer, slices)
        within_layer = padded.index_select(0, grid.numbers[layer + 1])
        _assign(out[slices], within_layer.index_select(0, keys.view(-1)).view(keys.shape), part)


def slice_multilinear(grid: BilateralGrid, values: Tensor, out: Tensor) -> None:
    """Give every voxel the mean of the occupied ones of the 16 cells around it, weighted multilinearly.

    Sums of value × weight and of weight are interpolated along K for a slice, then along J for its rows; `grid_sample`
    interpolates the last two axes, I and luma, at each voxel. A cell that is not occupied adds 0 to both sums.

    Args: as for `slice_nearest`.
    """
    import torch
    from torch.nn.functional import grid_sample

    layout = grid.voxel_cells.layout
    edge_k, edge_j, edge_i = layout.cell_voxels
    _, padded_columns, padded_lumas = layout.layer_shape
    value_and_weight = _with_absent_cell(torch.stack([values, torch.ones_like(values)]))

    @lru_cache(maxsize=2)
    def layer_table(layer: int) -> Tensor:
        table = value_and_weight.index_select(1, grid.numbers[layer + 1]).view(2, *layout.layer_shape)
        return table.transpose(0, 1).contiguous()

    rows, row_weights = _cells_below(layout.voxels[1], edge_j, out.device)
    columns, column_weights = _cells_below(layout.voxels[2], edge_i, out.device)
    # grid_sample's coordinates: (luma, I), where -1 and 1 are the first and the last cell of the padded row.
    places = torch.empty(layout.voxels[1], 1, layout.voxels[2], 2, device=out.device)
    places[..., 1] = (columns + column_weights) * (2.0 / (padded_columns - 1)) - 1.0
    slice_layers, slice_weights = _cells_below(layout.voxels[0], edge_k, "cpu")
    for layer, slices in layout.layers():
        part = grid.voxel_cells.taking_part(layer, slices)
        for k in range(slices.start, slices.stop):
            lower = int(slice_layers[k])
            table = torch.lerp(layer_table(lower), layer_table(lower + 1), float(slice_weights[k]))
            by_row = torch.lerp(table.index_select(0, rows), table.index_select(0, rows + 1), row_weights[:, None, None, None])
            places[:, 0, :, 0] = grid.voxel_cells.luma_coordinates(k) * (2.0 / (padded_lumas - 1)) - 1.0
            sums = grid_sample(by_row, places, mode="bilinear", padding_mode="border", align_corners=True)
            _assign(out[k], sums[:, 0, 0] / sums[:, 1, 0], None if part is None else part[k - slices.start])


def _with_absent_cell(values: Tensor) -> Tensor:
    """`values` (…, cells), followed by the 0 that places of the dense grid which are not occupied read."""
    from torch.nn.functional import pad

    return pad(values, (0, 1))


def _cells_below(voxels: int, edge: int, device: torch.device | str) -> tuple[Tensor, Tensor]:
    """Along one axis: the last cell whose centre is not beyond each voxel, and the weight in [0, 1) of the next one."""
    import torch

    coordinates = ((torch.arange(voxels, device=device) - 0.5 * (edge - 1)) / edge).clamp_(min=0.0)
    cells = coordinates.floor()
    return cells.to(torch.int32), coordinates - cells


def _assign(out: Tensor, values: Tensor, where: Tensor | None) -> None:
    """Overwrite `out` with `values`, where told."""
    import torch

    out.copy_(values if where is None else torch.where(where, values, out))
