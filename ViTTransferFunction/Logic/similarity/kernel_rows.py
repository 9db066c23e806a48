"""Kernels of places with all cells, kept from click to click."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.long_rows import long_rows
from ..core.volumes.torch_arrays import array_of, tensor_of

if TYPE_CHECKING:
    from torch import Tensor

CELLS_AT_ONCE = 256
"""Rows of so many cells are multiplied at a time, whose product stays near the processor: of whole rows it takes four times as
long."""
FEW_SUMS = 2
"""So many sums are computed one by one: each is bound by reading the rows once, which takes a third of a product's time."""
POINTS_OF_ROOM = 64
"""Points' rows come to further rooms of so many: to move all to a larger one keeps a click waiting for half a second. A room
takes memory where it is written to: to clear one first would take a tenth of a second."""
READ_ANYWAY = 2
"""So many rows that do not count are read with those before and behind them: to begin anew takes as long."""


class KernelRows:
    """Kernels with all cells: first one row for each background cell, then two for each point, which come and go.

    Rows are kept from click to click, so that a click costs two new rows and one product with those that count. Also where the
    processor has bfloat16 in hardware, they are in float32: without matrix units that is as fast, and a single sum much faster.

    The first row of a point is its kernel, to which some of the second may have been added (`add_second`); the second is the
    kernel times something else.

    Args:
        background: how many background cells there are.
        cells: how many cells, at least one.

    Attributes:
        background: the kernels of the background cells, (background, cells) float32, which whoever makes this has to write.
    """

    def __init__(self, background: int, cells: int) -> None:
        self._cells = cells
        self._background = long_rows(background, cells)
        self.background = array_of(self._background)
        # Of so many points each: first rows, and second ones.
        self._rooms: list[tuple[Tensor, Tensor]] = []
        self._slot_of_key: dict[bytes, int] = {}
        self._added_of_key: dict[bytes, float] = {}

    @property
    def count(self) -> int:
        """How many rows there are, also such as have not been written: weights of 0 keep them out of sums."""
        return len(self.background) + 2 * POINTS_OF_ROOM * len(self._rooms)

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Sums of rows, (sums, cells) float32, for weights (sums, count) float32: 0 for rows of no point."""
        import torch

        sums = torch.zeros((len(weights), self._cells))
        for rows, factors in self._counting(weights):
            _add_products(sums, factors, rows)
        return array_of(sums)

    def weighted_at(self, weights: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """One of those sums at some cells given by their indices, (cells,) float32, for weights (count,) float32."""
        import torch

        sums, places = torch.zeros((1, len(cells))), tensor_of(cells)
        for rows, factors in self._counting(weights[None]):
            _add_products(sums, factors, rows[:, places])
        return array_of(sums[0])

    def _counting(self, weights: np.ndarray) -> Iterator[tuple[Tensor, Tensor]]:
        """Stretches of rows (rows, cells) that are not multiplied by 0, and what they are multiplied by, (sums, rows)."""
        first = 0
        for room in (self._background, *itertools.chain.from_iterable(self._rooms)):
            of_room = weights[:, first : first + len(room)]
            for start, end in _stretches(np.flatnonzero(of_room.any(axis=0))):
                yield room[start:end], tensor_of(of_room[:, start:end])
            first += len(room)

    def indices(self, keys: Sequence[bytes], write: Callable[[int, np.ndarray], np.ndarray]) -> np.ndarray:
        """Which rows those of points are, (points, 2).

        Where there are none yet, `write` is given the point's index in `keys` and the first row, (cells,) float32, to write it;
        and returns what that is multiplied by in the second, (cells,) float32.

        Rows of a key that does not come again are forgotten; `write` may raise `Cancelled`, and those that it made are kept.
        """
        import torch

        for gone in self._slot_of_key.keys() - set(keys):
            del self._slot_of_key[gone], self._added_of_key[gone]
        taken = set(self._slot_of_key.values())
        # A stroke of hundreds of points that was undone would keep half a gigabyte.
        del self._rooms[max(taken, default=-1) // POINTS_OF_ROOM + 1 :]
        for index, key in enumerate(keys):
            if key not in self._slot_of_key:
                # The first that is free: what stands before any that is in use was written, if only by a point that is gone.
                slot = next(slot for slot in itertools.count() if slot not in taken)
                if slot == POINTS_OF_ROOM * len(self._rooms):
                    self._rooms.append((long_rows(POINTS_OF_ROOM, self._cells), long_rows(POINTS_OF_ROOM, self._cells)))
                own, times = self._rows_of(slot)
                torch.mul(own, tensor_of(write(index, array_of(own))), out=times)
                self._slot_of_key[key], self._added_of_key[key] = slot, 0.0
                taken.add(slot)
        rooms, places = np.divmod(np.array([self._slot_of_key[key] for key in keys], dtype=int), POINTS_OF_ROOM)
        first = len(self.background) + 2 * POINTS_OF_ROOM * rooms + places
        indices: np.ndarray = np.stack([first, first + POINTS_OF_ROOM], axis=1)
        return indices

    def added(self, keys: Sequence[bytes]) -> np.ndarray:
        """How often each point's second row has been added to its first, (points,)."""
        return np.array([self._added_of_key[key] for key in keys])

    def add_second(self, key: bytes, times: float) -> None:
        """Have a point's second row added so many times to its first: sums that need both in this proportion read one row."""
        if times != self._added_of_key[key]:
            first, second = self._rows_of(self._slot_of_key[key])
            first.add_(second, alpha=times - self._added_of_key[key])
            self._added_of_key[key] = times

    def _rows_of(self, slot: int) -> tuple[Tensor, Tensor]:
        room, place = divmod(slot, POINTS_OF_ROOM)
        first, second = self._rooms[room]
        return first[place], second[place]


def _stretches(counting: np.ndarray) -> list[tuple[int, int]]:
    """Where stretches of rows begin and end that hold those that count, given in order, and few others."""
    breaks = np.flatnonzero(np.diff(counting) > READ_ANYWAY + 1)
    begins, ends = np.append(-1, breaks) + 1, np.append(breaks, len(counting) - 1)
    return [(int(counting[begin]), int(counting[end]) + 1) for begin, end in zip(begins, ends, strict=True) if len(counting)]


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
