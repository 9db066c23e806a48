"""What can be reached from a block of a volume through blocks that are allowed, by steps along the axes.

Blocks are bits, 64 along I to a word: a word is filled from those beside it in a few operations, whatever is in it, and as many
words at once as have changed. That is twice as fast as to label all components of the volume, of which one is wanted, and many
times as fast where that one is small; and where more blocks are allowed later, it goes on from what is reached already.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

WORD_BITS = 64
_WORD = np.dtype("<u8")
_BITS = np.unpackbits(np.arange(2**16, dtype="<u2").view(np.uint8), bitorder="little")
_MIRRORED_BYTES = np.packbits(_BITS).view("<u2")
"""Two bytes, the bits of each in reverse order: to look up two at once takes half the time."""
_TO_FIRST_BIT = np.uint64(WORD_BITS - 1)


class FloodFill:
    """The blocks reached so far.

    Args:
        shape: (K, J, I) of the blocks.
        start: the block (k, j, i) to start from.
    """

    def __init__(self, shape: tuple[int, int, int], start: tuple[int, int, int]) -> None:
        self._shape = shape
        k, j, i = shape
        # Words along I, K, J, and around them a layer that nothing reaches, so that every word has neighbours.
        self._padded = (-(-i // WORD_BITS) + 2, k + 2, j + 2)
        row, plane = self._padded[2], self._padded[1] * self._padded[2]
        words = int(np.prod(self._padded))
        reached, changed = np.zeros(words, dtype=_WORD), np.zeros(words, dtype=bool)

        def shifted(array: np.ndarray, steps: int) -> np.ndarray:
            """For each word but the outermost planes', that many words further."""
            return array[plane + steps : words - plane + steps]

        self._all_reached = reached
        self._reached = shifted(reached, 0)
        self._beside = [shifted(reached, steps) for steps in (-1, 1, -row, row)]
        self._before, self._after = shifted(reached, -plane), shifted(reached, plane)
        self._due = shifted(changed, 0)
        self._due_beside = [shifted(changed, steps) for steps in (-1, 1, -row, row, -plane, plane)]
        first = np.zeros(shape, dtype=bool)
        first[start] = True
        self._reached |= self._packed(first)

    def through(self, allowed: np.ndarray) -> None:
        """Go on through blocks (K, J, I) bool, among which are all that were allowed before."""
        words = self._packed(allowed)
        mirrored = _mirrored(words)
        changed = np.flatnonzero(self._reached)
        self._reached[changed] = _filled(self._reached[changed], words[changed], mirrored[changed])
        unfinished = self._reached != words
        while changed.size:
            places = self._beside_of(changed, unfinished)
            allowed_here, before = words[places], self._reached[places]
            seeds = before | self._before[places] >> _TO_FIRST_BIT | self._after[places] << _TO_FIRST_BIT
            for beside in self._beside:
                seeds |= beside[places]
            seeds &= allowed_here
            new = np.flatnonzero(seeds != before)
            changed, allowed_there = places[new], allowed_here[new]
            filled = _filled(seeds[new], allowed_there, mirrored[changed])
            self._reached[changed] = filled
            unfinished[changed] = filled != allowed_there

    def cells(self, per_cell: int) -> np.ndarray:
        """Which cells of per_cell³ blocks hold one that is reached, (K / per_cell, …) uint8; per_cell divides `WORD_BITS`."""
        words = self._all_reached.reshape(self._padded)[1:-1, 1:-1, 1:-1]
        parts = [words[:, row::per_cell, column::per_cell] for row, column in np.ndindex(per_cell, per_cell)]
        words = reduce(np.bitwise_or, parts)
        for bit in range(1, per_cell):
            words = words | (words >> np.uint64(bit))
        rows = np.ascontiguousarray(np.moveaxis(words, 0, -1)).view(np.uint8)
        return np.unpackbits(rows, axis=2, count=self._shape[2], bitorder="little")[:, :, ::per_cell]

    def _packed(self, blocks: np.ndarray) -> np.ndarray:
        """Blocks (K, J, I) bool as words, all but the outermost planes."""
        k, j, _ = blocks.shape
        bits = np.packbits(blocks, axis=2, bitorder="little")
        rows = np.zeros((k, j, (self._padded[0] - 2) * WORD_BITS // 8), dtype=np.uint8)
        rows[:, :, : bits.shape[2]] = bits
        words = np.zeros((self._padded[0] - 2, *self._padded[1:]), dtype=_WORD)
        words[:, 1:-1, 1:-1] = np.moveaxis(rows.view(_WORD), -1, 0)
        return words.ravel()

    def _beside_of(self, changed: np.ndarray, unfinished: np.ndarray) -> np.ndarray:
        """The unfinished words beside those at some places, each once: their places."""
        for beside in self._due_beside:
            beside[changed] = True
        self._due &= unfinished
        places = np.flatnonzero(self._due)
        self._due[places] = False
        return places


def _filled(seeds: np.ndarray, allowed: np.ndarray, allowed_mirrored: np.ndarray) -> np.ndarray:
    """All runs of allowed bits in which there is a seed; seeds are allowed."""
    upwards = _filled_upwards(seeds, allowed)
    return _mirrored(_filled_upwards(_mirrored(upwards), allowed_mirrored))


def _filled_upwards(seeds: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Seeds, and the allowed bits above them: the sum carries from the lowest seed to the end of its run, and clears it."""
    filled: np.ndarray = seeds | (allowed & ~(allowed + seeds))
    return filled


def _mirrored(words: np.ndarray) -> np.ndarray:
    """Words with their bits in reverse order."""
    mirrored: np.ndarray = _MIRRORED_BYTES[words.byteswap().view("<u2")].view(_WORD)
    return mirrored
