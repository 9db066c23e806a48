"""Kernels of places with all cells, kept from click to click."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from ..core.torch_arrays import array_of, tensor_of

RESERVED_ROWS = 256
"""Room for as many is there from the beginning, and twice as much whenever it is full: it takes no memory before it is used,
and to move rows to a larger place keeps a click waiting."""
CELLS_AT_ONCE = 256
"""Rows of so many cells are multiplied at a time, whose product stays near the processor: of whole rows it takes four times as
long."""
FEW_SUMS = 2
"""So many sums are computed one by one: each is bound by reading the rows once, which takes a third of a product's time."""
_ALIGNMENT, _PADDING = 1024, 272
"""Rows begin at places in memory that differ by more than whole pages, or they would all compete for the same places of the
processor's caches: with 64³ cells, a product would take twice as long."""
ROWS_OF_POINT = 2
"""A point's kernel, and the same times its connectedness: how much the second counts differs from click to click."""


class KernelRows:
    """Kernels with all cells: first one row for each background cell, then two for each point, which come and go.

    Rows are kept from click to click, so that a click costs two new rows and one product with all of them. Also where the
    processor has bfloat16 in hardware, they are in float32: without matrix units that is as fast, and a single sum much faster.

    Args:
        background: how many background cells there are; `put_background` has to give all of their rows.
        cells: how many cells, at least one.
    """

    def __init__(self, background: int, cells: int) -> None:
        import torch

        self._background = background
        self._cells = cells
        self._room = torch.empty((0, -(-cells // _ALIGNMENT) * _ALIGNMENT + _PADDING))
        self._rows = self._room[:, :cells]
        self._make_room(background)
        self._row_of_key: dict[bytes, int] = {}
        self.count = background

    def put_background(self, first_cell: int, kernel: np.ndarray) -> None:
        """The kernels of the background cells with the cells from one on, (background, some) float32."""
        self._rows[: self._background, first_cell : first_cell + kernel.shape[1]] = tensor_of(kernel)

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Sums of rows, (sums, cells) float32, for weights (sums, count) float32: 0 for rows of no point."""
        import torch

        rows, factors = self._rows[: self.count], tensor_of(weights)
        sums = torch.empty((len(weights), self._cells))
        if len(weights) <= FEW_SUMS:
            for of_one, factor in zip(sums, factors, strict=True):
                torch.mv(rows.T, factor, out=of_one)
            return array_of(sums)
        whole = self._cells - self._cells % CELLS_AT_ONCE
        if whole:
            some_cells = rows[:, :whole].unflatten(1, (-1, CELLS_AT_ONCE)).movedim(1, 0)
            by_cells = factors.expand(len(some_cells), -1, -1) @ some_cells
            sums[:, :whole].unflatten(1, (-1, CELLS_AT_ONCE)).copy_(by_cells.movedim(0, 1))
        sums[:, whole:] = factors @ rows[:, whole:]
        return array_of(sums)

    def weighted_at(self, weights: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """One of those sums at some cells given by their indices, (cells,) float32, for weights (count,) float32."""
        return array_of(tensor_of(weights) @ self._rows[: self.count, tensor_of(cells)])

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
                self._rows[row : row + ROWS_OF_POINT] = tensor_of(made)
                self._row_of_key[key] = row
        self.count = max(taken, default=self._background - ROWS_OF_POINT) + ROWS_OF_POINT
        first = np.array([self._row_of_key[key] for key in keys])
        return first[:, None] + np.arange(ROWS_OF_POINT)

    def _make_room(self, rows: int) -> None:
        """Have `rows` rows; new ones are zero, since weights of 0 do not cancel what is no number."""
        before, length = self._room.shape
        if rows > before:
            room = self._room.new_empty((max(RESERVED_ROWS, rows, 2 * before), length))
            room[: len(self._rows), : self._cells] = self._rows
            self._room = room
        if rows > len(self._rows):
            self._room[len(self._rows) : rows, : self._cells] = 0.0
            self._rows = self._room[:rows, : self._cells]
