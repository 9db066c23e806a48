"""Kernels of places with all cells, kept from click to click."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from ..core.torch_arrays import array_of, tensor_of
from ..features.precision import device_precision

ROWS_AT_ONCE = 32
"""In bfloat16, rows are multiplied in groups of this many: for every new number of rows the processor's matrix kernels would be
compiled anew. In float32, they are not, and each row less is time less."""
RESERVED_ROWS = 256
"""Room for as many is there from the beginning, and twice as much whenever it is full: it takes no memory before it is used,
and to move rows to a larger place keeps a click waiting."""
CELLS_OF_BLOCK = 256
"""In float32, the rows of so many cells lie together, and their product stays near the processor: of whole rows it takes four
times as long. In bfloat16, whole rows are as fast or faster."""
ROWS_OF_POINT = 2
"""A point's kernel, and the same times its connectedness: how much the second counts differs from click to click."""


class KernelRows:
    """Kernels with all cells: first one row for each background cell, then two for each point, which come and go.

    Rows are kept from click to click, so that a click costs two new rows and one product with all of them. They are kept in
    bfloat16 where the processor has it in hardware: maps are then off by some thousandths.

    Args:
        background: how many background cells there are; `put_background` has to give all of their rows.
        cells: how many cells, at least one.
    """

    def __init__(self, background: int, cells: int) -> None:
        import torch

        self._background = background
        self._cells = cells
        dtype = device_precision(torch.device("cpu"))
        single = dtype is torch.float32
        self._block = CELLS_OF_BLOCK if single else cells
        self._group = 1 if single else ROWS_AT_ONCE
        # (blocks, rows, cells of a block)
        self._room = torch.empty((-(-cells // self._block), 0, self._block), dtype=dtype)
        self._rows = self._room
        self._make_room(background)
        self._row_of_key: dict[bytes, int] = {}
        self.count = self._rows.shape[1]

    def put_background(self, first_cell: int, kernel: np.ndarray) -> None:
        """The kernels of the background cells with the cells from one on, (background, some) float32.

        `first_cell` is a multiple of `CELLS_OF_BLOCK`.
        """
        self._put(slice(0, self._background), kernel, first_cell)

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Sums of rows, (sums, cells) float32, for weights (sums, count) float32: 0 for rows of no point."""
        rows = self._rows[:, : self.count]
        of_blocks = tensor_of(weights).to(rows.dtype).expand(len(rows), -1, -1) @ rows
        of_cells: np.ndarray = array_of(of_blocks.movedim(0, 1).flatten(1)[:, : self._cells].float())
        return of_cells

    def weighted_at(self, weights: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """One of those sums at some cells given by their indices, (cells,) float32, for weights (count,) float32."""
        block, within = np.divmod(cells, self._block)
        rows = self._rows[tensor_of(block), : self.count, tensor_of(within)]
        at_cells: np.ndarray = array_of(rows.float() @ tensor_of(weights))
        return at_cells

    def indices(self, keys: Sequence[bytes], compute: Callable[[int], np.ndarray]) -> np.ndarray:
        """The rows of points, (points, 2), where there are none yet by `compute`, from the point's index in `keys`.

        Rows of a key that does not come again are forgotten; `compute` may raise `Cancelled`, and those that it made are kept.
        """
        for gone in self._row_of_key.keys() - set(keys):
            del self._row_of_key[gone]
        taken = set(self._row_of_key.values())
        for index, key in enumerate(keys):
            if key not in self._row_of_key:
                made = compute(index)
                row = next(row for row in itertools.count(self._background, ROWS_OF_POINT) if row not in taken)
                taken.add(row)
                self._make_room(row + ROWS_OF_POINT)
                self._put(slice(row, row + ROWS_OF_POINT), made)
                self._row_of_key[key] = row
        self.count = self._whole_groups(max(taken, default=self._background - ROWS_OF_POINT) + ROWS_OF_POINT)
        first = np.array([self._row_of_key[key] for key in keys])
        return first[:, None] + np.arange(ROWS_OF_POINT)

    def _put(self, rows: slice, kernel: np.ndarray, first_cell: int = 0) -> None:
        """Some rows of some cells, (rows, cells) float32; where blocks are short, from the beginning of one on."""
        of_cells = tensor_of(kernel)
        block, within = divmod(first_cell, self._block)
        whole = 0 if within else kernel.shape[1] // self._block
        end = whole * self._block
        if whole:
            of_blocks = of_cells[:, :end].unflatten(1, (whole, self._block))
            self._rows[block : block + whole, rows] = of_blocks.movedim(0, 1)
        if end < kernel.shape[1]:
            self._rows[block + whole, rows, within : within + kernel.shape[1] - end] = of_cells[:, end:]

    def _make_room(self, rows: int) -> None:
        """Have `rows` rows, in whole groups; new ones are zero, since weights of 0 do not cancel what is no number."""
        blocks, before, cells = self._room.shape
        rows = self._whole_groups(rows)
        if rows > before:
            room = self._room.new_empty((blocks, max(RESERVED_ROWS, rows, 2 * before), cells))
            room[:, : self._rows.shape[1]] = self._rows
            self._room = room
        if rows > self._rows.shape[1]:
            self._room[:, self._rows.shape[1] : rows] = 0.0
            self._rows = self._room[:, :rows]

    def _whole_groups(self, rows: int) -> int:
        """`rows` rounded up to whole groups."""
        return -(-rows // self._group) * self._group
