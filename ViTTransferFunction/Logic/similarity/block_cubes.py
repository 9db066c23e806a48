"""The blocks of a volume in cubes of 4³, one cube after the other, so that those of a cube are the bits of one word."""

from __future__ import annotations

import numpy as np

EDGE = 4
BLOCKS_OF_CUBE = EDGE**3
"""As many as a word of the processor has bits."""


class BlockCubes:
    """Where each block lies.

    Args:
        shape: (K, J, I) of the blocks.

    Attributes:
        counts: of cubes along K, J, I, with a layer around those that hold blocks, so that each of these has neighbours.
    """

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self._shape = shape
        k, j, i = (-(-blocks // EDGE) + 2 for blocks in shape)
        self.counts = k, j, i

    def arranged(self, blocks: np.ndarray, elsewhere: int) -> np.ndarray:
        """Numbers of 8 or 16 bits that blocks have, (K, J, I), one cube after the other, (cubes · `BLOCKS_OF_CUBE`,).

        Args:
            blocks: the numbers.
            elsewhere: that of places in cubes where no block is.
        """
        k, j, i = self.counts
        whole_cubes = np.full([EDGE * count for count in self.counts], elsewhere, dtype=blocks.dtype)
        whole_cubes[tuple(slice(EDGE, EDGE + count) for count in self._shape)] = blocks
        rows = _rows(whole_cubes).reshape(k, EDGE, j, EDGE, i)
        one_after_the_other: np.ndarray = rows.transpose(0, 2, 4, 1, 3).ravel().view(blocks.dtype)
        return one_after_the_other

    def place(self, block: tuple[int, int, int]) -> int:
        """Where a block's number is among the arranged ones."""
        cube, within = np.divmod(np.array(block) + EDGE, EDGE)
        return int(np.ravel_multi_index((*cube, *within), (*self.counts, EDGE, EDGE, EDGE)))

    def restored(self, arranged: np.ndarray, each: int = 1) -> np.ndarray:
        """Bytes of blocks that are arranged in cubes, in the volume's order, (K / each, J / each, I / each).

        Args:
            arranged: (cubes · `BLOCKS_OF_CUBE`,) uint8.
            each: only of every second block along each axis, say, beginning with the first; divides `EDGE`.
        """
        k, j, i = (count - 2 for count in self.counts)
        some = EDGE // each
        rows = _rows(arranged).reshape(*self.counts, EDGE, EDGE)[1:-1, 1:-1, 1:-1, ::each, ::each]
        in_order = rows.transpose(0, 3, 1, 4, 2).ravel().view(arranged.dtype).reshape(k * some, j * some, i * EDGE)
        shape = [-(-count // each) for count in self._shape]
        blocks: np.ndarray = in_order[: shape[0], : shape[1], : self._shape[2] : each]
        return blocks


def _rows(numbers: np.ndarray) -> np.ndarray:
    """The numbers of each row of a cube as one: to move them together is several times as fast."""
    return numbers.view(f"u{EDGE * numbers.itemsize}")
