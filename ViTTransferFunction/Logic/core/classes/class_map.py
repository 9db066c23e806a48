"""What comes back about a class: a similarity map, and the threshold that selects the class on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..volumes.bounding_box import bounding_box
from ..volumes.geometry import Box, Geometry
from ..volumes.resampling import sample_at
from .class_request import ClassRequest
from .iso_proposals import IsoProposals

FULL_SCALE = 255
"""The byte that stands for a similarity of 1."""
NEAR_SHARE_OF_ISO = 0.5
"""Below this share of its iso value, a map is far from the surface: nothing there is refined, learned from, kept or drawn."""

_UNIT_BALL = np.array([place for place in (np.indices((9, 9, 9)).reshape(3, -1).T - 4) / 4.0 if np.linalg.norm(place) <= 1.0])
"""(257, 3)."""


@dataclass(frozen=True, eq=False)
class ClassMap:
    """How similar each cell or voxel is to a class.

    Attributes:
        array: (K, J, I) of `geometry`: float32 in [0, 1], or uint8 with 255 for 1. On feature cells it is S_L; on the volume's
            voxels, or on the box of them that matters, S_H.
        geometry: where the array lies, in the volume's frame.
        iso: threshold that selects the class, in [0, 1].
        proposals: the iso values of smaller and larger structures; None where the user fixed the iso value.
        prior: of S_L, what the points alone lead to expect of its iso value; None where a rule expects nothing.
    """

    array: np.ndarray
    geometry: Geometry
    iso: float
    proposals: IsoProposals | None = None
    prior: float | None = None

    def __post_init__(self) -> None:
        if self.array.shape != self.geometry.shape:
            raise ValueError(f"map of shape {self.array.shape} and geometry of shape {self.geometry.shape} differ")

    def resized(self, request: ClassRequest) -> ClassMap:
        """The same map with the iso value that `request` fixes, or with that of its size as far as that is known."""
        if request.iso is not None:
            return replace(self, iso=request.iso, proposals=None)
        return self if self.proposals is None else replace(self, iso=self.proposals.at(request.size))


def is_near(class_map: ClassMap, point_ras: np.ndarray, reach_mm: float) -> bool:
    """Whether a map reaches its iso value at a point (3,), RAS millimetres of its frame, or up to `reach_mm` from there."""
    around = ball_around(point_ras, reach_mm)
    return bool(is_inside(class_map, around[class_map.geometry.contains(around)]).any())


def ball_around(point_ras: np.ndarray, radius_mm: float) -> np.ndarray:
    """Places (N, 3) all over the ball around a point (3,), RAS millimetres: a quarter of the radius apart on any grid."""
    return point_ras + radius_mm * _UNIT_BALL


def is_inside(class_map: ClassMap, points_ras: np.ndarray) -> np.ndarray:
    """(N,) bool: whether a map, interpolated, reaches its iso value at points (N, 3), RAS millimetres of its frame."""
    values = sample_at(class_map.array[..., None], class_map.geometry, points_ras)[:, 0]
    inside: np.ndarray = values >= in_units_of(class_map.array, class_map.iso)
    return inside


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
    least = in_units_of(array, similarity)
    # Bytes are compared with bytes, many times faster.
    return bounding_box(array >= (math.ceil(least) if array.dtype == np.uint8 else least), margin)
