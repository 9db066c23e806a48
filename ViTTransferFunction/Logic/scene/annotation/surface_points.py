"""Points placed in 3D views.

There, Slicer places a point on the visible surface under the mouse, which is the border of a structure. A feature on a border
is as much that of the neighbour, so the point would say little: it belongs a little further inside.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import slicer
from scipy import ndimage

from ...core.classes.class_map import ClassMap, in_units_of
from ...core.volumes.geometry import Box, transform_points

REACH_MM = 6.0
"""How far a point is moved at most in a body; further where the map's cells are larger. About the size of a cell."""
REACH_VOXELS = 12
"""But no further than this in a fine scan, whose cells are smaller: the box that is looked at grows with the third power."""


def placed_in_3d_view(scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic) -> bool:
    """Whether the user is placing points, and the mouse is over something in a 3D view."""
    interaction, crosshair = app_logic.GetInteractionNode(), scene.GetSingletonNode("default", "vtkMRMLCrosshairNode")
    if crosshair is None or interaction.GetCurrentInteractionMode() != slicer.vtkMRMLInteractionNode.Place:
        return False
    # Slice views tell which of them the mouse is in, 3D views only where.
    position = [0.0, 0.0, 0.0]
    return bool(crosshair.GetCursorPositionRAS(position)) and crosshair.GetCursorPositionXYZ(position) is None


def moved_inside(point_ras: np.ndarray, maps: Iterable[ClassMap], map_to_world: np.ndarray, scale: float) -> np.ndarray:
    """A point on the surface of a class's map, moved to where the class is deepest nearby.

    Args:
        point_ras: (3,) RAS millimetres in the scene.
        maps: of the classes whose surfaces are seen.
        map_to_world: (4, 4), from the maps' frame to the scene's.
        scale: of lengths that are meant for bodies (`body_scale`), in the maps' frame.

    Returns:
        (3,) RAS millimetres in the scene; `point_ras` itself where it lies on no surface.
    """
    local_ras = transform_points(np.linalg.inv(map_to_world), point_ras)[0]
    nearby = [place for class_map in maps if (place := _deepest_nearby(local_ras, class_map, scale)) is not None]
    if not nearby:
        return point_ras
    _, deepest_ras = min(nearby, key=lambda place: place[0])
    return transform_points(map_to_world, deepest_ras)[0]


def _deepest_nearby(point_ras: np.ndarray, class_map: ClassMap, scale: float) -> tuple[float, np.ndarray] | None:
    """How far the class is from the point, and its deepest place within reach; None where its surface is out of reach."""
    geometry = class_map.geometry
    spacing_kji = geometry.spacing_mm[::-1]
    reach_mm = max(min(scale * REACH_MM, REACH_VOXELS * float(spacing_kji.min())), float(spacing_kji.max()))
    point_kji = geometry.ras_to_ijk(point_ras[None])[0, ::-1]
    # Twice the reach, so that the depth of what is within reach is known.
    box = _box_around(point_kji, np.ceil(2.0 * reach_mm / spacing_kji), geometry.shape)
    inside = class_map.array[box] >= in_units_of(class_map.array, class_map.iso)
    offset_kji = np.moveaxis(np.indices(inside.shape), 0, -1) + [extent.start for extent in box] - point_kji
    near_by_voxels = (np.abs(offset_kji) <= 1.5).all(axis=-1)
    distance_mm = np.linalg.norm(offset_kji * spacing_kji, axis=-1)
    reached = inside & (distance_mm <= reach_mm)
    if not reached.any() or inside[near_by_voxels].all():
        return None
    depth_mm = ndimage.distance_transform_edt(inside, sampling=spacing_kji)
    # Of places that are equally deep, the nearest.
    best = np.unravel_index(np.where(reached, depth_mm - 1e-3 * distance_mm, -np.inf).argmax(), inside.shape)
    moved_kji = point_kji + offset_kji[best]
    return float(distance_mm[reached].min()), geometry.ijk_to_ras_points(moved_kji[None, ::-1])[0]


def _box_around(point_kji: np.ndarray, reach: np.ndarray, shape: tuple[int, int, int]) -> Box:
    """The voxels within `reach` of a point along each axis, as far as the array goes; empty beyond it."""
    middle = np.rint(point_kji)
    starts, stops = (np.clip(corner, 0, shape).astype(int).tolist() for corner in (middle - reach, middle + reach + 1))
    k, j, i = (slice(start, stop) for start, stop in zip(starts, stops, strict=True))
    return k, j, i
