"""What comes back about a class: a similarity map, and the threshold that selects the class on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .bounding_box import bounding_box
from .class_request import ClassRequest
from .geometry import Box, Geometry
from .iso_proposals import IsoProposals
from .resampling import sample_at

FULL_SCALE = 255
"""The byte that stands for a similarity of 1."""
NEAR_SHARE_OF_ISO = 0.5
"""Below this share of its iso value, a map is far from the surface: nothing there is refined, learned from, kept or drawn."""


@dataclass(frozen=True, eq=False)
class ClassMap:
    """How similar each cell or voxel is to a class.

    Attributes:
        array: (K, J, I) of `geometry`: float32 in [0, 1], or uint8 with 255 for 1. On feature cells it is S_L; on the volume's
            voxels, or on the box of them that matters, S_H.
        geometry: where the array lies, in the volume's frame.
        iso: threshold that selects the class, in [0, 1].
        proposals: the iso values of smaller and larger structures; None where the user fixed the iso value.
    """

    array: np.ndarray
    geometry: Geometry
    iso: float
    proposals: IsoProposals | None = None

    def __post_init__(self) -> None:
        if self.array.shape != self.geometry.shape:
            raise ValueError(f"map of shape {self.array.shape} and geometry of shape {self.geometry.shape} differ")

    def resized(self, request: ClassRequest) -> ClassMap:
        """The same map with the iso value that `request` fixes, or with that of its size as far as that is known."""
        if request.iso is not None:
            return replace(self, iso=request.iso, proposals=None)
        return self if self.proposals is None else replace(self, iso=self.proposals.at(request.size))


def is_near(class_map: ClassMap, point_ras: np.ndarray, reach_mm: float) -> bool:
    """Whether a map reaches its iso value at a point (3,), RAS millimetres of its frame, or up to `reach_mm` from there.

    It is looked for at the point and, in 26 directions, half as far and as far as it reaches.
    """
    directions = np.array(list(np.ndindex(3, 3, 3)), dtype=float) - 1.0
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1.0)
    around = point_ras + np.concatenate([0.5 * reach_mm * directions, reach_mm * directions])
    around = around[class_map.geometry.contains(around)]
    values = sample_at(class_map.array[..., None], class_map.geometry, around)
    return bool((values >= in_units_of(class_map.array, class_map.iso)).any())


def in_units_of(array: np.ndarray, similarity: float) -> float:
    """A similarity in [0, 1] as a map's `array` expresses it: as it is, or with 255 for 1 if that is uint8."""
    return FULL_SCALE * similarity if array.dtype == np.uint8 else similarity


def box_above(array: np.ndarray, similarity: float, margin: int) -> Box | None:
    """The smallest box of a map that holds all voxels of at least `similarity`, and a margin; None if there are none.

    Args:
        array: (K, J, I) float32 in [0, 1], or uint8 with 255 for 1.
        similarity: in [0, 1].
        margin: voxels on every side, as far as the map reaches.
    """
    return bounding_box(array >= in_units_of(array, similarity), margin)
