"""Kernels of places with all cells, kept from click to click."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..features.precision import device_precision

if TYPE_CHECKING:
    import torch

CELLS_OF_BLOCK = 256
"""The rows of so many cells lie together, and their product stays near the processor. Whole rows, which matrix libraries cut up
and copy first, take half as long again in bfloat16, and four times as long in float32."""
ROWS_OF_POINT = 2
"""A point's kernel, and the same times its connectedness: how much the second counts differs from click to click."""
POINTS_OF_CHUNK = 32
"""Room is made for so many points at once: for every new number of rows the processor's matrix kernels would be compiled anew,
and to move rows to a larger place would keep a click waiting."""


class KernelRows:
    """Kernels with all cells: first one row for each background cell, then two for each point, which come and go.

    Rows are kept from click to click, so that a click costs two new rows and one product with all of them. They are kept in
    bfloat16 where the processor has it in hardware: maps are then off by some thousandths.

    Args:
        background: how many background cells there are; `put_background` has to give all of their rows.
        cells: how many cells.
    """

    def __init__(self, background: int, cells: int) -> None:
        import torch

        self._cells = cells
        # As all chunks (blocks, rows, cells of a block), each contiguous: of others, matrix libraries make copies.
        blocks = -(-cells // CELLS_OF_BLOCK)
        self._background = torch.zeros((blocks, background, CELLS_OF_BLOCK), dtype=device_precision(torch.device("cpu")))
        self._chunks: list[torch.Tensor] = []
        self._place_of_key: dict[bytes, int] = {}

    @property
    def count(self) -> int:
        """How many rows there are, those included in which there is no point now."""
        return sum(chunk.shape[1] for chunk in self._all_chunks)

    @property
    def _all_chunks(self) -> list[torch.Tensor]:
        return [self._background, *self._chunks]

    def put_background(self, first_cell: int, kernel: np.ndarray) -> None:
        """The kernels of the background cells with the cells from one on, (background, some) float32.

        `first_cell` is a multiple of `CELLS_OF_BLOCK`, and so are the cells, unless they are the last.
        """
        _put(self._background[first_cell // CELLS_OF_BLOCK :], kernel)

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """Sums of rows, (sums, cells) float32, for weights (sums, count) float32: 0 for rows of no point."""
        import torch

        chunks = self._all_chunks
        parts = torch.from_numpy(weights).split([chunk.shape[1] for chunk in chunks], dim=1)
        products = (part.to(rows.dtype).expand(len(rows), -1, -1) @ rows for part, rows in zip(parts, chunks, strict=True))
        sums = next(products).float()
        for product in products:
            sums += product
        of_cells: np.ndarray = sums.movedim(0, 1).flatten(1)[:, : self._cells].numpy()
        return of_cells

    def indices(self, keys: Sequence[bytes], compute: Callable[[int], np.ndarray]) -> np.ndarray:
        """The rows of points, (points, 2), where there are none yet by `compute`, from the point's index in `keys`.

        Rows of a key that does not come again are forgotten; `compute` may raise `Cancelled`, and those that it made are kept.
        """
        for gone in self._place_of_key.keys() - set(keys):
            del self._place_of_key[gone]
        taken = set(self._place_of_key.values())
        for index, key in enumerate(keys):
            if key not in self._place_of_key:
                made = compute(index)
                place = next(place for place in itertools.count() if place not in taken)
                taken.add(place)
                self._put_point(place, made)
                self._place_of_key[key] = place
        del self._chunks[max(taken, default=-1) // POINTS_OF_CHUNK + 1 :]
        places = np.array([self._place_of_key[key] for key in keys])
        first = self._background.shape[1] + ROWS_OF_POINT * places
        return first[:, None] + np.arange(ROWS_OF_POINT)

    def _put_point(self, place: int, rows: np.ndarray) -> None:
        chunk, place_in_chunk = divmod(place, POINTS_OF_CHUNK)
        while chunk >= len(self._chunks):
            # Of zeros, since weights of 0 do not cancel what is no number.
            blocks = len(self._background)
            self._chunks.append(self._background.new_zeros((blocks, ROWS_OF_POINT * POINTS_OF_CHUNK, CELLS_OF_BLOCK)))
        first = ROWS_OF_POINT * place_in_chunk
        _put(self._chunks[chunk][:, first : first + ROWS_OF_POINT], rows)


def _put(chunk: torch.Tensor, rows: np.ndarray) -> None:
    """Rows (rows, cells) float32 into a chunk (blocks, rows, cells of a block) of as many cells or more."""
    import torch

    blocks, rest = divmod(rows.shape[1], CELLS_OF_BLOCK)
    of_cells = torch.from_numpy(rows)
    whole = of_cells[:, : blocks * CELLS_OF_BLOCK].unflatten(1, (blocks, CELLS_OF_BLOCK))
    chunk[:blocks] = whole.movedim(0, 1)
    if rest:
        chunk[blocks, :, :rest] = of_cells[:, -rest:]
