"""A volume's layers, some after the others, so that little is held at once."""

from __future__ import annotations

from typing import NamedTuple


class Part(NamedTuple):
    """Some layers along K, and as many around them as what is done to them reaches.

    Attributes:
        layers: of the volume.
        around: the same and those around them.
        within: the layers, in those around.
    """

    layers: slice
    around: slice
    within: slice


def parts(shape: tuple[int, ...], voxels: int, reach: int) -> list[Part]:
    """All of a volume (K, J, I), so many voxels at a time, and one layer at least; `reach` in layers."""
    count = max(voxels // (shape[1] * shape[2]), 1)
    found = []
    for start in range(0, shape[0], count):
        stop, first = min(start + count, shape[0]), max(start - reach, 0)
        found.append(Part(slice(start, stop), slice(first, min(stop + reach, shape[0])), slice(start - first, stop - first)))
    return found
