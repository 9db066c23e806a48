"""Slices of different lengths one after the other in the rows of one array, in few sizes.

Every layer of a network but attention works on rows alone, so no slice is padded to the longest. But processors' libraries
compile kernels for every new number of rows, and keep them: some milliseconds and a third of a megabyte each time, between
which batches that come and go fragment the memory. So there are few different numbers of rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

SLICE_STEP = 32
"""Slices of chosen patches get rows in multiples of it: also what a processor's matrix units like best."""
BATCH_STEP = 128
"""All slices together get rows in multiples of it."""


@dataclass(frozen=True, eq=False)
class PatchTokens:
    """One slice as the network reads it: patches of a grid, perhaps not all of them.

    Attributes:
        patches: (T, 3·p²) pixels, channel by channel, normalised as the model expects.
        rows, columns: the slice's grid of patches.
        places: (T,) int64, row · columns + column of each patch; None where all are there, row by row.
        multiplicity: (T,) how many alike patches each stands for, itself included; None where each stands for itself.
    """

    patches: Tensor
    rows: int
    columns: int
    places: Tensor | None = None
    multiplicity: Tensor | None = None


class PackedSlices:
    """Which rows belong to which slice: each slice's prefix tokens, its patches, and perhaps padding.

    Args:
        slices: what is packed.
        prefix_tokens: number of tokens of a slice that are no patches (class and registers); they come first.

    Attributes:
        rows: of the array; the last ones belong to no slice.
        spans: rows of each slice, padding included.
        patches: rows of each slice's patches.
    """

    def __init__(self, slices: Sequence[PatchTokens], prefix_tokens: int) -> None:
        self.spans: list[slice] = []
        self.patches: list[slice] = []
        end = 0
        for of_slice in slices:
            start, length = end, prefix_tokens + len(of_slice.patches)
            # Where all patches are there, slices are alike as it is, and attention does without a mask.
            end = start + (length if of_slice.multiplicity is None else _up_to_multiple(length, SLICE_STEP))
            self.spans.append(slice(start, end))
            self.patches.append(slice(start + prefix_tokens, start + length))
        self.rows = _up_to_multiple(end, BATCH_STEP)


def _up_to_multiple(number: int, step: int) -> int:
    return -(-number // step) * step
