"""Gross corrections: clicks deep within what is wrong, which tell that a structure is not found in the whole scan."""

from __future__ import annotations

import numpy as np

from ..volumes.geometry import Geometry
from .class_map import ClassMap, ball_around, is_inside


def corrects_grossly(class_map: ClassMap, geometry: Geometry, point_ras: np.ndarray, positive: bool, depth_mm: float) -> bool:
    """Whether a new point lies more than `depth_mm` within what is wrong: beyond what is shown, or off the structure within it.

    Only the ball of this radius around the point is looked at, as far as it lies in the volume.

    Args:
        class_map: what is shown of the structure; beyond its grid, nothing is.
        geometry: of the volume, in the same frame.
        point_ras: (3,) RAS millimetres. One beyond the volume corrects nothing.
        positive: whether it is on the structure.
        depth_mm: above 0, such as the edge of a cell: errors that are less deep are what cells are too large for.
    """
    if not geometry.contains(point_ras[None])[0]:
        return False
    around = ball_around(point_ras, depth_mm)
    around = around[geometry.contains(around)]
    mapped = class_map.geometry.contains(around)
    inside = is_inside(class_map, around[mapped])
    return not inside.any() if positive else bool(mapped.all() and inside.all())
