"""A box of a volume that is looked at by itself: what is small and thin in the whole scan is large in its own box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..system.errors import InputError, shown
from ..system.given_numbers import FARTHEST, is_number
from ..volumes.geometry import Box, Geometry

EdgesMm = tuple[float, float, float]
"""Of a box, along the volume's axes I, J and K, millimetres."""

POINT_MARGIN = 0.15
"""Around a point that was placed beyond the box, of the box's longest edge."""
LEAST_VOXELS = 16
"""Of a box along each axis, as far as the volume has so many."""

_ROUNDING = 1e-3
"""Of a voxel: a box that was saved and read again is the same one, and its features are in the cache."""


@dataclass(frozen=True)
class CloseUp:
    """A box along a volume's axes.

    Attributes:
        centre_ras: R, A and S of its centre, millimetres.
        size_mm: its edges along the volume's axes I, J and K, above 0.

    Raises:
        InputError: they are not three finite numbers each, or an edge has no length.
    """

    centre_ras: tuple[float, float, float]
    size_mm: tuple[float, float, float]

    def __post_init__(self) -> None:
        for name, lowest in (("centre_ras", -FARTHEST), ("size_mm", 0.0)):
            values = getattr(self, name)
            if not _are_three_numbers(values, lowest):
                raise InputError(
                    f"'{name}' of a close-up is {shown(values)}; expected three numbers in millimetres"
                    f"{', each above 0' if name == 'size_mm' else ''}."
                )
            x, y, z = (float(value) for value in values)
            object.__setattr__(self, name, (x, y, z))

    @classmethod
    def of_box(cls, box: Box, geometry: Geometry) -> CloseUp:
        """The close-up that fills a box of a volume's voxels."""
        part = geometry.part(box)
        middle = (np.array(part.shape[::-1]) - 1.0) / 2.0
        return cls(tuple(part.ijk_to_ras_points(middle[None])[0].tolist()), tuple(part.extent_mm.tolist()))

    def box_in(self, geometry: Geometry, points_ras: np.ndarray) -> Box:
        """The voxels that it covers in a volume, and those around points beyond it: it follows the clicks.

        Args:
            geometry: of the volume.
            points_ras: the structure's positive points (N, 3), N ≥ 1, in the volume.
        """
        spacing = geometry.spacing_mm[::-1]
        half = np.array(self.size_mm[::-1]) / spacing / 2.0
        centre = geometry.ras_to_ijk(np.array([self.centre_ras]))[0, ::-1]
        low, high = centre - half + 0.5, centre + half + 0.5
        points = geometry.ras_to_ijk(points_ras)[:, ::-1] + 0.5
        beyond = points[((points < low) | (points > high)).any(axis=1)]
        if len(beyond):
            around = POINT_MARGIN * max(self.size_mm) / spacing
            low = np.minimum(low, (beyond - around).min(axis=0))
            high = np.maximum(high, (beyond + around).max(axis=0))
        return box_of_voxels(low, high, geometry.shape)

    def enlarged(self, geometry: Geometry, points_ras: np.ndarray) -> CloseUp:
        """What `box_in` covers, as a close-up: the one in use."""
        return self.of_box(self.box_in(geometry, points_ras), geometry)


def box_of_voxels(low: np.ndarray, high: np.ndarray, shape: tuple[int, int, int]) -> Box:
    """The voxels between two corners, in voxels from the volume's corner; widened to `LEAST_VOXELS`, within the volume."""
    extents = []
    for first, last, size in zip(low, high, shape, strict=True):
        least = min(LEAST_VOXELS, size)
        widened = max(least - (last - first), 0.0) / 2.0
        start = int(np.clip(np.floor(first - widened + _ROUNDING), 0, size - least))
        extents.append(slice(start, int(np.clip(np.ceil(last + widened - _ROUNDING), start + least, size))))
    k, j, i = extents
    return k, j, i


def _are_three_numbers(values: Any, above: float) -> bool:
    if not isinstance(values, (list, tuple)) or len(values) != 3:
        return False
    return all(is_number(value) and above < value < FARTHEST for value in values)
