"""Packs slices of different lengths into the rows of one array, with few different numbers of rows.

All layers of a network except attention work on single rows, so slices need not be padded to the longest. But libraries for
CPUs compile and keep kernels for every new number of rows, which takes some milliseconds and a third of a megabyte each time,
and fragments the memory of batches. So there are few different numbers of rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

SLICE_STEP = 32
"""Slices of chosen patches are padded to a multiple of this number of rows, which also suits a CPU's matrix units."""
BATCH_STEP = 128
"""All slices together are padded to a multiple of this number of rows."""


@dataclass(frozen=True, eq=False)
class PatchTokens:
    """The patches of one slice that the network gets: all patches of a grid, or some of them.

    Attributes:
        patches: (T, 3·p²) pixels, channel by channel, normalised as the model expects.
        rows, columns: size of the slice's grid of patches.
        places: (T,) int64, row · columns + column of each patch; None: all patches, row by row.
        multiplicity: (T,) number of similar patches that each represents, including itself; None: each represents only itself.
    """

    patches: Tensor
    rows: int
    columns: int
    places: Tensor | None = None
    multiplicity: Tensor | None = None


class PackedSlices:
    """The rows of each slice: its prefix tokens, its patches, and padding if needed.

    Args:
        slices: the slices to pack.
        prefix_tokens: number of tokens before a slice's patches (class and register tokens).

    Attributes:
        rows: number of rows of the array; the last ones may belong to no slice.
        spans: rows of each slice, including padding.
        patches: rows of each slice's patches.
    """

    def __init__(self, slices: Sequence[PatchTokens], prefix_tokens: int) -> None:
        self.spans: list[slice] = []
        self.patches: list[slice] = []
        end = 0
        for of_slice in slices:
            start, length = end, prefix_tokens + len(of_slice.patches)
            # Slices with all patches have equal lengths without padding, and attention needs no mask.
            end = start + (length if of_slice.multiplicity is None else _up_to_multiple(length, SLICE_STEP))
            self.spans.append(slice(start, end))
            self.patches.append(slice(start + prefix_tokens, start + length))
        self.rows = _up_to_multiple(end, BATCH_STEP)


def _up_to_multiple(number: int, step: int) -> int:
    return -(-number // step) * step
