"""Regions that the user encloses become points: lines drawn in a slice view, Slicer's own closed curves and boxes (ROI)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import slicer
from vtkmodules.util.numpy_support import vtk_to_numpy

from ..core.errors import InputError
from ..core.region_points import points_within_box, points_within_outline
from .annotations import SceneAnnotations
from .nodes import nodes_of_class
from .volume import numpy_matrix

_MARKUPS = ("vtkMRMLMarkupsClosedCurveNode", "vtkMRMLMarkupsROINode")


class SceneRegions:
    """Adds a handful of points of a region's inside to a class: each time one step for undo.

    Args:
        scene: has the markups.
        annotations: get the points.
        in_volume: tells which of some points (N, 3), RAS millimetres in the scene, lie in the volume; the others are dropped.
    """

    def __init__(
        self, scene: slicer.vtkMRMLScene, annotations: SceneAnnotations, in_volume: Callable[[np.ndarray], np.ndarray]
    ) -> None:
        self._scene = scene
        self._annotations = annotations
        self._in_volume = in_volume

    @property
    def markups(self) -> dict[str, str]:
        """The closed curves and boxes in the scene that are drawn to the end: their names by their node IDs."""
        nodes = (node for name in _MARKUPS for node in nodes_of_class(self._scene, name))
        return {node.GetID(): node.GetName() for node in nodes if not node.GetHideFromEditors() and _is_complete(node)}

    def add_outline(self, id_: str, outline_ras: np.ndarray, positive: bool) -> None:
        """Add points within a closed outline (N, 3), RAS millimetres in one plane, to a class.

        Raises:
            InputError: none of them lies in the volume.
        """
        self._add(id_, points_within_outline(outline_ras), positive)

    def add_markup(self, id_: str, node_id: str, positive: bool) -> None:
        """Add points within one of `markups` to a class; a curve is taken to lie in the plane nearest to it. The markup stays.

        Raises:
            InputError: none of them lies in the volume.
        """
        self._add(id_, _points_within(self._scene.GetNodeByID(node_id)), positive)

    def _add(self, id_: str, points_ras: np.ndarray, positive: bool) -> None:
        points_ras = points_ras[self._in_volume(points_ras)]
        if not len(points_ras):
            raise InputError("No part of the region lies in the volume, so no points were added. Draw it on the volume.")
        self._annotations.add_points(id_, points_ras, positive)


def _is_complete(node: slicer.vtkMRMLMarkupsNode) -> bool:
    least = 3 if node.IsA("vtkMRMLMarkupsClosedCurveNode") else 1
    return bool(node.GetNumberOfDefinedControlPoints() >= least)


def _points_within(node: slicer.vtkMRMLMarkupsNode) -> np.ndarray:
    if node.IsA("vtkMRMLMarkupsROINode"):
        size_mm = [0.0, 0.0, 0.0]
        node.GetSizeWorld(size_mm)
        return points_within_box(numpy_matrix(node.GetObjectToWorldMatrix()), np.array(size_mm))
    return points_within_outline(vtk_to_numpy(node.GetCurvePointsWorld().GetData()).astype(np.float64))
