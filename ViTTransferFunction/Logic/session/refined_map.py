"""A class's map at the volume's resolution, and its threshold."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.volumes.voxel_map import VoxelMap


@dataclass(frozen=True, eq=False)
class RefinedMap:
    """S_H of a class, and its threshold.

    Attributes:
        voxels: S_H.
        iso: threshold that selects the class, in [0, 1].
    """

    voxels: VoxelMap
    iso: float
