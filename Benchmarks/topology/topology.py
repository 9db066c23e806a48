"""How many parts, tunnels and cavities a shape has."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import ndimage

from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box

_ALL_NEIGHBOURS = np.ones((3, 3, 3))


@dataclass(frozen=True)
class Topology:
    """Betti numbers of a shape whose voxels touch by faces, edges or corners; its outside touches by faces alone.

    Attributes:
        components: connected parts.
        tunnels: handles: 0 of a ball, 1 of a torus.
        cavities: enclosed hollows.
    """

    components: int
    tunnels: int
    cavities: int

    @property
    def euler(self) -> int:
        """Components − tunnels + cavities: 1 of a ball, 0 of a torus."""
        return self.components - self.tunnels + self.cavities


def topology_of(mask: np.ndarray) -> Topology:
    """Count what a mask (K, J, I) bool has of each."""
    box = bounding_box(mask)
    if box is None:
        return Topology(0, 0, 0)
    padded = np.pad(mask[box], 1)
    _, components = ndimage.label(padded, structure=_ALL_NEIGHBOURS)
    _, outsides = ndimage.label(~padded)
    cavities = outsides - 1
    return Topology(components, components + cavities - euler_number(mask[box]), cavities)


def euler_number(mask: np.ndarray) -> int:
    """Vertices − edges + faces − cubes of the voxels of a mask (K, J, I) bool, each counted once where voxels share it."""
    padded = np.pad(mask, 1)
    total = 0
    for shared in range(4):
        for axes in combinations(range(3), shared):
            # A face lies between two voxels, an edge between four, a vertex between eight: it is there if one of them is.
            there = padded
            for axis in axes:
                there = np.delete(there, -1, axis) | np.delete(there, 0, axis)
            total += (-1) ** (3 - shared) * int(np.count_nonzero(there))
    return total
