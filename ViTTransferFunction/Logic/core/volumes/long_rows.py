"""Rows of numbers so long that it matters where in memory each begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

_ALIGNMENT, _PADDING = 1024, 272
"""Rows begin at places in memory that differ by more than whole pages, or they would all compete for the same places of the
processor's caches: with 64³ columns, a product with many rows would take twice as long."""


def long_rows(rows: int, columns: int) -> Tensor:
    """Rows (rows, columns) float32 of whatever the memory holds, each one after the other, with gaps in between.

    It takes memory where it is written to.
    """
    import torch

    return torch.empty((rows, -(-columns // _ALIGNMENT) * _ALIGNMENT + _PADDING))[:, :columns]
