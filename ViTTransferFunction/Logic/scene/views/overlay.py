"""A class's similarity map over the slices: its colour, the stronger the more similar.

The map is a layer of its own in all slice views, over what the user chose to see there.

It is a label map whose labels are similarities: of a scalar volume, Slicer shows each voxel fully or not at all, whatever
its colour table says. Label maps are shown without interpolation, so coarse maps are interpolated here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.classes.class_map import ClassMap, box_above, in_units_of
from ...core.classes.colors import Color
from ...core.volumes.geometry import Geometry
from ...core.volumes.resampling import cell_positions, interpolated
from ..mrml.derived_nodes import DerivedNodes
from ..volumes.volume_nodes import set_image
from .slice_layer import SliceLayer

if TYPE_CHECKING:
    import slicer

VOLUME_NAME = "Similarity"
COLORS_NAME = "Similarity colors"

FADE_IN = (0.4, 0.7, 1.0, 1.3)
FADE_IN_OPACITY = (0.0, 0.12, 0.5, 0.75)
"""Opacity of the overlay at multiples of the iso value: nothing to see well below it, most of it right above."""

LEVELS = 256

FINE_VOXELS = 2_000_000
"""Voxels up to which a coarse map is refined."""

MOST_VOXELS_PER_CELL = 6


class SimilarityOverlay:
    """Shows one map at a time in all slice views.

    Args:
        scene: where slice views and volumes are.
        app_logic: of the application, which knows the logics of the slice views.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic) -> None:
        self._nodes = DerivedNodes(scene)
        self._layer = SliceLayer(scene, app_logic)

    def show(self, volume_node: slicer.vtkMRMLScalarVolumeNode, class_map: ClassMap, color: Color, opacity: float) -> None:
        """Show a map, or another one instead, in all slice views.

        Args:
            volume_node: the volume that the map is of; the overlay moves with it.
            class_map: in the volume's local frame.
            color: of the class.
            opacity: in [0, 1].
        """
        levels, geometry = similarity_levels(class_map, FADE_IN[0] * class_map.iso)
        colors = self._nodes.find(COLORS_NAME) or self._add_colors()
        _set_colors(colors, class_map.iso, color)
        volume = self._nodes.find(VOLUME_NAME) or self._nodes.add("vtkMRMLLabelMapVolumeNode", VOLUME_NAME)
        if volume.GetDisplayNode() is None:
            volume.CreateDefaultDisplayNodes()
            volume.GetDisplayNode().SetSaveWithScene(False)
        volume.GetDisplayNode().SetAndObserveColorNodeID(colors.GetID())
        volume.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
        set_image(volume, levels, geometry.ijk_to_ras)
        self._layer.show(volume, opacity)

    def hide(self) -> None:
        """Take the overlay out of all slice views."""
        self._layer.hide()

    def remove(self) -> None:
        """Hide the overlay, and take its nodes out of the scene."""
        self._layer.remove()
        self._nodes.remove()

    def _add_colors(self) -> Any:
        colors = self._nodes.add("vtkMRMLColorTableNode", COLORS_NAME)
        colors.SetTypeToUser()
        colors.SetNumberOfColors(LEVELS)
        return colors


def _set_colors(colors: Any, iso: float, color: Color) -> None:
    """The colour of the class for all levels, with opacities that depend on the level."""
    similarity = np.linspace(0.0, 1.0, LEVELS)
    opacity = np.interp(similarity, [*np.multiply(FADE_IN, iso), max(1.0, 1.5 * iso)], [*FADE_IN_OPACITY, 1.0])
    was_modifying = colors.StartModify()
    for level, alpha in enumerate(opacity.tolist()):
        colors.SetColor(level, *color, alpha)
    colors.EndModify(was_modifying)


def similarity_levels(class_map: ClassMap, threshold: float) -> tuple[np.ndarray, Geometry]:
    """A map in 256 levels, where it is above `threshold`, in [0, 1], and right around; finer if it is coarse.

    Returns:
        (K, J, I) uint8, trilinearly interpolated, with 255 for 1; and where it lies.
    """
    array = class_map.array
    box = box_above(array, threshold, margin=1)
    if box is None:
        return np.zeros((1, 1, 1), dtype=np.uint8), Geometry((1, 1, 1), class_map.geometry.ijk_to_ras)
    values, geometry = array[box], class_map.geometry.part(box)
    per_cell = min(int(np.cbrt(FINE_VOXELS / values.size)), MOST_VOXELS_PER_CELL)
    if per_cell <= 1 and values.dtype == np.uint8:
        return values, geometry
    # As much as can be before there are more of them: a click waits for this. With half a level more, cutting off rounds.
    levels = np.float32(255.0 / in_units_of(array, 1.0)) * values
    levels = np.clip(levels, 0.0, 255.0, out=levels) + np.float32(0.5)
    if per_cell > 1:
        levels = interpolated(levels, [cell_positions(count, per_cell * count) for count in levels.shape])
        geometry = geometry.resized(levels.shape)
    return levels.astype(np.uint8), geometry
