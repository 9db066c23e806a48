"""The structures as they are shown: which points of the scene lie on them."""

from __future__ import annotations

import numpy as np
import slicer

from ...compute.proxy import SegmentationProxy
from ...core.classes.class_map import is_near
from ..interface.parameters import SceneParameters
from ..mrml.transforms import matrix_to_world, world_to_local
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .selected_class import SelectedClass
from .surface_points import moved_inside, placed_in_3d_view

REACH_OF_STRUCTURE_MM = 3.0
"""How far beyond its border one still points at a structure of a body: about as well as people aim."""


class ShownStructures:
    """Compares points with the maps of visible classes.

    Args:
        scene: the scene.
        app_logic: the application's logic.
        parameters: say which volume.
        annotations: say which classes are visible.
        selected: which class.
        volume: as it was opened.
        proxy: has the maps.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        selected: SelectedClass,
        volume: OpenedVolume,
        proxy: SegmentationProxy,
    ) -> None:
        self._scene = scene
        self._app_logic = app_logic
        self._parameters = parameters
        self._annotations = annotations
        self._selected = selected
        self._volume = volume
        self._proxy = proxy

    def is_on_selected(self, point_ras: np.ndarray) -> bool:
        """Whether a point (3,), RAS millimetres, lies on the selected class's structure, or right beside it."""
        volume, selected = self._parameters.volume, self._selected.state
        class_map = self._proxy.maps.get(selected.id) if selected and selected.visible else None
        content = self._volume.content
        if volume is None or class_map is None or content is None or self._volume.changed:
            return False
        return is_near(class_map, world_to_local(volume, point_ras)[0], content.geometry.body_scale * REACH_OF_STRUCTURE_MM)

    def settled(self, point_ras: np.ndarray) -> np.ndarray:
        """Where a point is to lie that was placed at `point_ras`, (3,) RAS millimetres: itself, or a place inside a structure.

        The latter if it was placed on a structure's surface, in a 3D view.
        """
        volume, content = self._parameters.volume, self._volume.content
        if volume is None or content is None or not placed_in_3d_view(self._scene, self._app_logic):
            return point_ras
        visible = {state.id for state in self._annotations.classes if state.visible}
        maps = [class_map for id_, class_map in self._proxy.maps.items() if id_ in visible]
        return moved_inside(point_ras, maps, matrix_to_world(volume), content.geometry.body_scale)
