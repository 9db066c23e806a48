"""Memory that is used again for every batch, so that batches of different sizes do not fragment it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch
    from torch import Tensor

ROWS_STEP = 1024
"""Buffers get rows in multiples of it: a slightly larger batch finds its place in them."""


class BufferPool:
    """Named buffers, each as large as the largest use of it so far."""

    def __init__(self) -> None:
        self._buffers: dict[str, Tensor] = {}

    def rows(self, name: str, rows: int, columns: int, dtype: torch.dtype, device: torch.device) -> Tensor:
        """A buffer (rows, columns), holding whatever was left in it. A name always asks for the same columns."""
        import torch

        if name not in self._buffers or len(self._buffers[name]) < rows:
            self._buffers.pop(name, None)
            wanted = -(-rows // ROWS_STEP) * ROWS_STEP
            self._buffers[name] = torch.empty(wanted, columns, dtype=dtype, device=device)
        return self._buffers[name][:rows]
