"""Rows of the kernel matrix, of background cells and annotated points with all cells, kept between clicks."""

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
"""Matrix products are computed for this many cells at a time, so that the result stays in the processor's cache; with whole
rows they take four times as long."""
FEW_SUMS = 2
"""Up to this many sums are computed one by one. Each is limited by reading the rows from memory once, which takes a third of
the time of a matrix product."""
POINTS_OF_ROOM = 64
"""Rows are allocated in blocks ("rooms") for this many points: copying all of them to a larger array would delay a click by
half a second. Blocks are not zeroed, which would take a tenth of a second, and so take up memory only where they are written
to."""
READ_ANYWAY = 2
"""Up to this many consecutive rows of weight 0 are read together with the rows around them: a new product takes as long."""


class KernelRows:
    """Kernel rows with all cells: one for each background cell, then two for each point, which are added and dropped.

    Rows are kept between clicks, so that a click costs two new rows and one product with all rows in use. They are float32 even
    if the processor supports bfloat16: without matrix units that is as fast, and a single sum is much faster.

    The first row of a point is its kernel, to which a multiple of the second row may have been added (`add_second`). The second
    row is the kernel times a factor for each cell.

    Args:
        background: number of background cells.
        cells: number of cells, at least one.

    Attributes:
        background: the rows of the background cells, (background, cells) float32; the caller fills them in.
    """

    def __init__(self, background: int, cells: int) -> None:
        self._cells = cells
        self._background = long_rows(background, cells)
        self.background = array_of(self._background)
        # First and second rows, of `POINTS_OF_ROOM` points each.
        self._rooms: list[tuple[Tensor, Tensor]] = []
        self._slot_of_key: dict[bytes, int] = {}
        self._added_of_key: dict[bytes, float] = {}

    @property
    def count(self) -> int:
        """Number of rows, including those not written yet; these need a weight of 0."""
        return len(self.background) + 2 * POINTS_OF_ROOM * len(self._rooms)

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Weighted sums of all rows.

        Args:
            weights: (sums, count) float32; 0 for rows that belong to no point.

        Returns:
            (sums, cells) float32.
        """
        import torch

        sums = torch.zeros((len(weights), self._cells))
        for rows, factors in self._counting(weights):
            _add_products(sums, factors, rows)
        return array_of(sums)

    def weighted_at(self, weights: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """One weighted sum at some of the cells.

        Args:
            weights: (count,) float32; 0 for rows that belong to no point.
            cells: indices of cells, (n,).

        Returns:
            (n,) float32.
        """
        import torch

        sums, places = torch.zeros((1, len(cells))), tensor_of(cells)
        for rows, factors in self._counting(weights[None]):
            _add_products(sums, factors, rows[:, places])
        return array_of(sums[0])

    def _counting(self, weights: np.ndarray) -> Iterator[tuple[Tensor, Tensor]]:
        """Yield ranges of rows with weights other than 0, (rows, cells), and their weights, (sums, rows)."""
        first = 0
        for room in (self._background, *itertools.chain.from_iterable(self._rooms)):
            of_room = weights[:, first : first + len(room)]
            for start, end in _stretches(np.flatnonzero(of_room.any(axis=0))):
                yield room[start:end], tensor_of(of_room[:, start:end])
            first += len(room)

    def indices(self, keys: Sequence[bytes], write: Callable[[int, np.ndarray], np.ndarray]) -> np.ndarray:
        """The indices of the points' rows, (points, 2).

        Missing rows are computed; rows of other keys are dropped.

        Args:
            keys: a key for each point.
            write: called for a missing point with its index in `keys` and its first row, (cells,) float32, which it fills in.
                It returns the factors of the second row, (cells,) float32. It may raise `Cancelled`; rows that are complete by
                then are kept.
        """
        import torch

        for gone in self._slot_of_key.keys() - set(keys):
            del self._slot_of_key[gone], self._added_of_key[gone]
        taken = set(self._slot_of_key.values())
        # Otherwise an undone stroke of hundreds of points would hold half a gigabyte.
        del self._rooms[max(taken, default=-1) // POINTS_OF_ROOM + 1 :]
        for index, key in enumerate(keys):
            if key not in self._slot_of_key:
                # The first free slot. Thus all rows before one in use have been written, if only for a former point: some of
                # them are read with a weight of 0 (`READ_ANYWAY`), where uninitialised memory could hold NaN.
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
        """The multiple of each point's second row that has been added to its first, (points,)."""
        return np.array([self._added_of_key[key] for key in keys])

    def add_second(self, key: bytes, times: float) -> None:
        """Make `times` the multiple of a point's second row that is added to its first.

        Sums that need both rows in this proportion then read only one.
        """
        if times != self._added_of_key[key]:
            first, second = self._rows_of(self._slot_of_key[key])
            first.add_(second, alpha=times - self._added_of_key[key])
            self._added_of_key[key] = times

    def _rows_of(self, slot: int) -> tuple[Tensor, Tensor]:
        room, place = divmod(slot, POINTS_OF_ROOM)
        first, second = self._rooms[room]
        return first[place], second[place]


def _stretches(counting: np.ndarray) -> list[tuple[int, int]]:
    """Start and end of ranges of rows that contain all of `counting` (sorted) and few others."""
    breaks = np.flatnonzero(np.diff(counting) > READ_ANYWAY + 1)
    begins, ends = np.append(-1, breaks) + 1, np.append(breaks, len(counting) - 1)
    return [(int(counting[begin]), int(counting[end]) + 1) for begin, end in zip(begins, ends, strict=True) if len(counting)]


def _add_products(sums: Tensor, factors: Tensor, rows: Tensor) -> None:
    """Add factors (S, R) times rows (R, cells) to sums (S, cells)."""
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
