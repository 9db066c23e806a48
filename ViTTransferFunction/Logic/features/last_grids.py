"""What follows from a slice's grid of patches, remembered because every slice of an axis has the same."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

MOST_GRIDS = 3
"""Of the three axes. A network sees many more, of one volume and close-up after the other, and each takes megabytes."""


class LastGrids:
    """Tensors by grid, of the grids that came last; for several threads at once."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int], Tensor] = {}
        self._looking = threading.Lock()

    def of(self, rows: int, columns: int, make: Callable[[], Tensor]) -> Tensor:
        """That of a grid; `make` makes it where it is not there."""
        grid = rows, columns
        with self._looking:
            if grid not in self._kept:
                while len(self._kept) >= MOST_GRIDS:
                    del self._kept[next(iter(self._kept))]
                self._kept[grid] = make()
            return self._kept[grid]
