"""Kernels of places with all cells, kept from click to click."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from ..features.precision import device_precision

ROWS_AT_ONCE = 32
"""Rows are multiplied in blocks of this many."""
RESERVED_ROWS = 256
"""Room for as many is there from the beginning, and twice as much whenever it is full: it takes no memory before it is used,
and to move rows to a larger place keeps a click waiting."""


ROWS_OF_POINT = 2
"""A point's kernel, and the same times its connectedness: how much the second counts differs from click to click."""


class KernelRows:
    """Kernels with all cells: first one row for each background cell, then two for each point, which come and go.

    Rows are kept from click to click, so that a click costs two new rows and one product with all of them. That product waits
    for memory, so rows are kept in bfloat16 where the processor has it in hardware: maps are then off by some thousandths.

    Args:
        background: how many background cells there are; `put_background` has to give all of their rows.
        cells: how many cells.
    """

    def __init__(self, background: int, cells: int) -> None:
        import torch

        self._background = background
        self._room = torch.empty((0, cells), dtype=device_precision(torch.device("cpu")))
        self._rows = self._room
        self._make_room(background)
        self._row_of_key: dict[bytes, int] = {}
        self.count = len(self._rows)

    def put_background(self, cells: slice, kernel: np.ndarray) -> None:
        """The kernels of the background cells with some cells, (background, some) float32."""
        import torch

        self._rows[: self._background, cells] = torch.from_numpy(kernel)

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Sums of rows, (sums, cells) float32, for weights (sums, count) float32: 0 for rows of no point."""
        import torch

        return (torch.from_numpy(weights).to(self._rows.dtype) @ self._rows[: self.count]).float().numpy()

    def indices(self, keys: Sequence[bytes], compute: Callable[[int], np.ndarray]) -> np.ndarray:
        """The rows of points, (points, 2), where there are none yet by `compute`, from the point's index in `keys`.

        Rows of a key that does not come again are forgotten; `compute` may raise `Cancelled`, and those that it made are kept.
        """
        import torch

        for gone in self._row_of_key.keys() - set(keys):
            del self._row_of_key[gone]
        taken = set(self._row_of_key.values())
        for index, key in enumerate(keys):
            if key not in self._row_of_key:
                made = torch.from_numpy(compute(index))
                row = next(row for row in itertools.count(self._background, ROWS_OF_POINT) if row not in taken)
                taken.add(row)
                self._make_room(row + ROWS_OF_POINT)
                self._rows[row : row + ROWS_OF_POINT] = made
                self._row_of_key[key] = row
        self.count = _whole_blocks(max(taken, default=self._background - ROWS_OF_POINT) + ROWS_OF_POINT)
        first = np.array([self._row_of_key[key] for key in keys])
        return first[:, None] + np.arange(ROWS_OF_POINT)

    def _make_room(self, rows: int) -> None:
        """Have `rows` rows, in whole blocks; new ones are zero, since weights of 0 do not cancel what is no number."""
        rows = _whole_blocks(rows)
        if rows > len(self._room):
            room = self._room.new_empty((max(RESERVED_ROWS, rows, 2 * len(self._room)), self._room.shape[1]))
            room[: len(self._rows)] = self._rows
            self._room = room
        if rows > len(self._rows):
            self._room[len(self._rows) : rows] = 0.0
            self._rows = self._room[:rows]


def _whole_blocks(rows: int) -> int:
    """`rows` rounded up to whole blocks: for every new number of rows the processor's matrix kernels would be compiled anew."""
    return -(-rows // ROWS_AT_ONCE) * ROWS_AT_ONCE
