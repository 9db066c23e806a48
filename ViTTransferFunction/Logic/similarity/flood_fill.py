"""What can be reached from a block of a volume through blocks that are allowed, by steps along the axes.

Blocks are bits, a cube of 4³ to a word (`block_cubes`): a few operations fill as many words at once as have something beside
them that was reached. NumPy takes a quarter of a microsecond for each of them, however little it is about, and ways wind: what
counts is in how few steps they are gone. Of cubes these are a third as many as of words along rows of blocks. Where more blocks
are allowed later, it goes on from what is reached already.
"""

from __future__ import annotations

import numpy as np

from .block_cubes import BLOCKS_OF_CUBE, EDGE, BlockCubes

_WORD = np.dtype("<u8")
_ROUNDS = 3
"""How often what was reached in a cube spreads along each axis and back before it goes on to the cubes beside it. Most are
filled then; those that are not come again."""


def _number(value: int) -> np.ndarray:
    """A word that arrays are combined with. NumPy takes one that is an array for half as long as one that is a number."""
    return np.array(value, dtype=_WORD)


def _layers(axis: int) -> tuple[int, int]:
    """The bits of a cube that are the first along an axis, and those that are the last."""
    index = np.indices((EDGE,) * 3)[axis].ravel().tolist()
    first, last = (sum(1 << bit for bit, at in enumerate(index) if at == layer) for layer in (0, EDGE - 1))
    return first, last


_ALL_BITS = (1 << BLOCKS_OF_CUBE) - 1
_AXES = [(EDGE ** (2 - axis), *_layers(axis)) for axis in (2, 1, 0)]
"""From I to K: by how many bits a step along the axis goes, the bits of the first layer, and those of the last."""
_STEPS = [
    step
    for bits, first, last in _AXES
    for step in (
        (np.left_shift, _number(bits), _number(_ALL_BITS ^ first)),
        (np.right_shift, _number(bits), _number(_ALL_BITS ^ last)),
    )
]
"""Within a cube, along each axis and back: which way bits go, by how many, and to which ones they may."""
_ENTRIES = [
    entry
    for bits, first, last in _AXES
    for entry in (
        (np.right_shift, _number(bits * (EDGE - 1)), _number(first)),
        (np.left_shift, _number(bits * (EDGE - 1)), _number(last)),
    )
]
"""The same from the cube before, and from the one after."""


class FloodFill:
    """The blocks reached so far.

    Args:
        cubes: how the blocks are arranged.
        start: the block (k, j, i) to start from.
    """

    def __init__(self, cubes: BlockCubes, start: tuple[int, int, int]) -> None:
        words = int(np.prod(cubes.counts))
        row, plane = cubes.counts[2], cubes.counts[1] * cubes.counts[2]
        reached, changed = np.zeros(words, dtype=_WORD), np.zeros(words, dtype=bool)

        def shifted(array: np.ndarray, steps: int) -> np.ndarray:
            """For each cube but the outermost planes', what is so many further."""
            return array[plane + steps : words - plane + steps]

        beside = [sign * steps for steps in (1, row, plane) for sign in (-1, 1)]
        self._all_reached, self._inner = reached, slice(plane, words - plane)
        self._reached, self._changed = shifted(reached, 0), shifted(changed, 0)
        self._reached_beside = [shifted(reached, steps) for steps in beside]
        self._changed_beside = [shifted(changed, steps) for steps in beside]
        self._due = np.zeros(len(self._changed), dtype=bool)
        cube, bit = divmod(cubes.place(start), BLOCKS_OF_CUBE)
        reached[cube] = 1 << bit

    def through(self, allowed: np.ndarray) -> None:
        """Go on through blocks, (cubes · `BLOCKS_OF_CUBE`,) bool, among which are all that were allowed before."""
        words = np.packbits(allowed, bitorder="little").view(_WORD)[self._inner]
        reached, changed = self._reached, self._changed
        unfinished = reached != words
        np.not_equal(reached, 0, changed)
        while (places := self._due_of(unfinished)).size:
            before, allowed_here = reached.take(places), words.take(places)
            found = self._entered(places)
            found |= before
            found &= allowed_here
            _spread(found, allowed_here)
            new = np.flatnonzero(found != before)
            places, found = places.take(new), found.take(new)
            reached[places] = found
            unfinished[places] = found != allowed_here.take(new)
            changed.fill(False)
            changed[places] = True

    def reached(self, blocks_per_cell: int) -> np.ndarray:
        """Which blocks are reached, (cubes · `BLOCKS_OF_CUBE`,) uint8.

        Args:
            blocks_per_cell: along each axis, divides `EDGE`; the first block of a cell tells whether any of its blocks is.
        """
        words = self._all_reached
        for bits, _, _ in _AXES:
            for _ in range(blocks_per_cell - 1):
                words = words | (words >> _number(bits))
        return np.unpackbits(words.view(np.uint8), bitorder="little")

    def _due_of(self, unfinished: np.ndarray) -> np.ndarray:
        """The unfinished cubes that have changed, and those beside such: their places."""
        due = self._due
        np.copyto(due, self._changed)
        for beside in self._changed_beside:
            np.logical_or(due, beside, due)
        np.logical_and(due, unfinished, due)
        return due.nonzero()[0]

    def _entered(self, places: np.ndarray) -> np.ndarray:
        """What those beside some cubes would reach in these, were all of it allowed."""
        entered = np.zeros(len(places), dtype=_WORD)
        for beside, (shift, bits, layer) in zip(self._reached_beside, _ENTRIES, strict=True):
            entering = beside.take(places)
            shift(entering, bits, entering)
            np.bitwise_and(entering, layer, entering)
            np.bitwise_or(entered, entering, entered)
        return entered


def _spread(found: np.ndarray, allowed: np.ndarray) -> None:
    """Reach on within cubes, in place, from found blocks through allowed ones."""
    steps = [(shift, bits, allowed & entered) for shift, bits, entered in _STEPS]
    moved = np.empty_like(found)
    for _ in range(_ROUNDS):
        for shift, bits, allowed_there in steps:
            shift(found, bits, moved)
            np.bitwise_and(moved, allowed_there, moved)
            np.bitwise_or(found, moved, found)
