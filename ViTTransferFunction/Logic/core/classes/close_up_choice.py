"""Chooses the box of a close-up: it encloses the clicked part of a structure's map, its points, and a margin."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from ..system.errors import InputError
from ..volumes.bounding_box import bounding_box
from ..volumes.geometry import Box, Geometry
from .class_map import ClassMap, in_units_of
from .close_up import CloseUp, box_of_voxels

MARGIN = 0.045
"""Margin around a structure, as a share of the volume's longest edge: the box must include the surroundings for comparison."""
LARGEST_SHARE = 0.15
"""Largest box, as a share of the volume; a larger one shows little more detail than the whole volume.

It is not smaller, since long, thin structures have large boxes, and may improve. The largest box in
`Benchmarks/results/close_up.json`, that of an aorta, fills a tenth of its scan, and has 0.25 more Dice at five clicks.
Structures that lose are mostly those that the whole volume already shows well, which the size of the box does not tell.
"""
_NEIGHBOURS = np.ones((3, 3, 3), dtype=bool)


def close_up_of(similarity: ClassMap, points_ras: np.ndarray, geometry: Geometry, reach_mm: float = math.inf) -> CloseUp:
    """The close-up of a structure whose extent is estimated from its map and its points, with a margin.

    Args:
        similarity: the structure's map on the volume's cells or voxels, or on a part of them.
        points_ras: its positive points (N, 3), N ≥ 1, RAS millimetres.
        geometry: grid of the volume.
        reach_mm: largest extent of the structure beyond the box of its points, whatever its map shows.

    Raises:
        InputError: the box would be larger than `LARGEST_SHARE` of the volume.
    """
    points = geometry.ras_to_ijk(points_ras)[:, ::-1] + 0.5
    low, high = points.min(axis=0), points.max(axis=0)
    reach = reach_mm / geometry.spacing_mm[::-1]
    lowest, highest = low - reach, high + reach
    box = _clicked_part(similarity, points_ras)
    if box is not None:
        corners = np.array([[extent.start - 0.5, extent.stop - 0.5] for extent in box[::-1]]).T
        ends = geometry.ras_to_ijk(similarity.geometry.ijk_to_ras_points(corners))[:, ::-1] + 0.5
        low, high = np.minimum(low, ends.min(axis=0)), np.maximum(high, ends.max(axis=0))
        low, high = np.maximum(low, lowest), np.minimum(high, highest)
    margin = MARGIN * geometry.extent_mm.max() / geometry.spacing_mm[::-1]
    voxels = box_of_voxels(low - margin, high + margin, geometry.shape)
    share = math.prod(extent.stop - extent.start for extent in voxels) / math.prod(geometry.shape)
    if share > LARGEST_SHARE:
        raise InputError(
            f"This structure's box fills {share:.0%} of the scan, and would show little more than the whole does. A closer "
            f"look is for structures whose box fills at most {LARGEST_SHARE:.0%}."
        )
    return CloseUp.of_box(voxels, geometry)


def _clicked_part(similarity: ClassMap, points_ras: np.ndarray) -> Box | None:
    """The box of the map's components above its iso value that contain points; None if there are none."""
    return bounding_box(clicked_components(similarity, points_ras, similarity.iso))


def clicked_components(similarity: ClassMap, points_ras: np.ndarray, threshold: float) -> np.ndarray:
    """Components of a map, at least `threshold` in [0, 1], that contain at least one of the points (N, 3): (K, J, I) bool."""
    components, _ = ndimage.label(similarity.array >= in_units_of(similarity.array, threshold), _NEIGHBOURS)
    places = similarity.geometry.nearest_voxels(points_ras[similarity.geometry.contains(points_ras)])
    numbers = components[tuple(places.T)]
    held: np.ndarray = np.isin(components, numbers[numbers > 0])
    return held
