"""Learned position embeddings, for any grid of patches."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .last_grids import LastGrids

if TYPE_CHECKING:
    import torch
    from torch import Tensor


class PositionTable:
    """A learned position table, resized to the grids that are asked for.

    Args:
        table: (1, 1 + n², C), the class token's entry first.
        dtype: of what it gives.
    """

    def __init__(self, table: Tensor, dtype: torch.dtype) -> None:
        self._table, self._dtype = table, dtype
        self._resized = LastGrids()

    def resized(self, rows: int, columns: int) -> Tensor:
        """Position embeddings (1 + rows·columns, C)."""

        def resize() -> Tensor:
            # On the processor: before version 2.8, PyTorch cannot do this on Apple's graphics processors.
            table = interpolate_position_table(self._table.cpu().float(), rows, columns)[0]
            return table.to(self._table.device, self._dtype)

        return self._resized.of(rows, columns, resize)


def interpolate_position_table(table: Tensor, rows: int, columns: int) -> Tensor:
    """Resize a learned position table to another patch grid, bicubic with anti-aliasing; the class entry is kept.

    Args:
        table: (1, 1 + n², C), the class token's entry first.
        rows: of the patch grid to resize to.
        columns: of it.

    Returns:
        (1, 1 + rows·columns, C); `table` itself where the grid is n × n already.
    """
    import torch
    import torch.nn.functional as F

    side = math.isqrt(table.shape[1] - 1)
    if (rows, columns) == (side, side):
        return table
    grid = table[:, 1:].reshape(1, side, side, -1).permute(0, 3, 1, 2)
    grid = F.interpolate(grid, size=(rows, columns), mode="bicubic", antialias=True, align_corners=False)
    return torch.cat([table[:, :1], grid.flatten(2).transpose(1, 2)], dim=1)
