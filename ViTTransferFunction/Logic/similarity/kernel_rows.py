"""Kernels of places with all cells, kept from click to click."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..core.long_rows import long_rows
from ..core.torch_arrays import array_of, tensor_of

if TYPE_CHECKING:
    from torch import Tensor

CELLS_AT_ONCE = 256
"""Rows of so many cells are multiplied at a time, whose product stays near the processor: of whole rows it takes four times as
long."""
FEW_SUMS = 2
"""So many sums are computed one by one: each is bound by reading the rows once, which takes a third of a product's time."""
ROWS_OF_POINT = 2
"""A point's kernel, and the same times its connectedness: how much the second counts differs from click to click."""
ROWS_OF_ROOM = 128
"""Points' rows come to further rooms of so many, a multiple of `ROWS_OF_POINT`: to move all to a larger one keeps a click
waiting for half a second. A room takes memory where it is written to: to clear one first would take a tenth of a second."""


class KernelRows:
    """Kernels with all cells: first one row for each background cell, then two for each point, which come and go.

    Rows are kept from click to click, so that a click costs two new rows and one product with all of them. Also where the
    processor has bfloat16 in hardware, they are in float32: without matrix units that is as fast, and a single sum much faster.

    Args:
        background: how many background cells there are.
        cells: how many cells, at least one.

    Attributes:
        background: the kernels of the background cells, (background, cells) float32, which whoever makes this has to write.
        count: how many rows there are, those of points that are gone among them.
    """

    def __init__(self, background: int, cells: int) -> None:
        self._cells = cells
        # Of the background cells, and of points.
        self._rooms = [long_rows(background, cells)]
        self.background = array_of(self._rooms[0])
        self._row_of_key: dict[bytes, int] = {}
        self.count = background

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Sums of rows, (sums, cells) float32, for weights (sums, count) float32: 0 for rows of no point."""
        import torch

        sums = torch.zeros((len(weights), self._cells))
        for rows, factors in self._in_rooms(tensor_of(weights)):
            _add_products(sums, factors, rows)
        return array_of(sums)

    def weighted_at(self, weights: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """One of those sums at some cells given by their indices, (cells,) float32, for weights (count,) float32."""
        import torch

        sums, places = torch.zeros((1, len(cells))), tensor_of(cells)
        for rows, factors in self._in_rooms(tensor_of(weights[None])):
            _add_products(sums, factors, rows[:, places])
        return array_of(sums[0])

    def _in_rooms(self, weights: Tensor) -> Iterator[tuple[Tensor, Tensor]]:
        """The rows (rows, cells) of each room, as far as it is used, and what they are multiplied by, (sums, rows)."""
        first = 0
        for room in self._rooms:
            used = min(len(room), self.count - first)
            if used > 0:
                yield room[:used], weights[:, first : first + used]
            first += len(room)

    def indices(self, keys: Sequence[bytes], write: Callable[[int, np.ndarray], np.ndarray]) -> np.ndarray:
        """The rows of points, (points, 2): a kernel, and the same times something else.

        Where there are none yet, `write` is given the point's index in `keys` and the first row, (cells,) float32, to write it;
        and returns what that is multiplied by in the second, (cells,) float32.

        Rows of a key that does not come again are forgotten; `write` may raise `Cancelled`, and those that it made are kept.
        """
        import torch

        for gone in self._row_of_key.keys() - set(keys):
            del self._row_of_key[gone]
        taken = set(self._row_of_key.values())
        for index, key in enumerate(keys):
            if key not in self._row_of_key:
                row = next(row for row in itertools.count(len(self.background), ROWS_OF_POINT) if row not in taken)
                room, within = divmod(row - len(self.background), ROWS_OF_ROOM)
                while len(self._rooms) < room + 2:
                    self._rooms.append(long_rows(ROWS_OF_ROOM, self._cells))
                own, times = self._rooms[room + 1][within : within + ROWS_OF_POINT]
                torch.mul(own, tensor_of(write(index, array_of(own))), out=times)
                self._row_of_key[key] = row
                taken.add(row)
        # Those of points that are gone stay among them, but are numbers, which weights of 0 cancel.
        self.count = max(taken, default=len(self.background) - ROWS_OF_POINT) + ROWS_OF_POINT
        first = np.array([self._row_of_key[key] for key in keys])
        return first[:, None] + np.arange(ROWS_OF_POINT)


def _add_products(sums: Tensor, factors: Tensor, rows: Tensor) -> None:
    """Add to sums (S, cells) the factors (S, R) times the rows (R, cells)."""
    if len(sums) <= FEW_SUMS:
        for of_one, factor in zip(sums, factors, strict=True):
            of_one.addmv_(rows.T, factor)
        return
    whole = rows.shape[1] - rows.shape[1] % CELLS_AT_ONCE
    if whole:
        some_cells = rows[:, :whole].unflatten(1, (-1, CELLS_AT_ONCE)).movedim(1, 0)
        by_cells = factors.expand(len(some_cells), -1, -1) @ some_cells
        sums[:, :whole].unflatten(1, (-1, CELLS_AT_ONCE)).add_(by_cells.movedim(0, 1))
    sums[:, whole:] += factors @ rows[:, whole:]
