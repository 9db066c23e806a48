"""Regions, outlines and diameters become points: drawn in a slice view, or as Slicer's closed curves, boxes (ROI) and lines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import slicer
from vtkmodules.util.numpy_support import vtk_to_numpy

from ...core.classes.diameter_points import points_of_diameter
from ...core.classes.region_points import points_of_outline, points_within_box, points_within_outline
from ...core.system.errors import InputError
from ..mrml.nodes import nodes_of_class
from ..mrml.transforms import numpy_matrix
from .annotations import SceneAnnotations

_CURVE, _BOX, _LINE = "vtkMRMLMarkupsClosedCurveNode", "vtkMRMLMarkupsROINode", "vtkMRMLMarkupsLineNode"
_LEAST_POINTS = {_CURVE: 3, _BOX: 1, _LINE: 2}
"""By the kind of a markup: from how many points on it is drawn to the end."""


class SceneRegions:
    """Adds points of a region's inside to a class, or those that an outline or a diameter stands for: each time one undo step.

    Args:
        scene: has the markups.
        annotations: get the points.
        in_volume: tells which of some points (N, 3), RAS millimetres in the scene, lie in the volume; the others are dropped.
        body_scale: of lengths in the scene that are meant for bodies, in that volume.
        on_outline: is told of each outline whose points were added: the class's id, and (N, 3) RAS millimetres in the scene.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        annotations: SceneAnnotations,
        in_volume: Callable[[np.ndarray], np.ndarray],
        body_scale: Callable[[], float],
        on_outline: Callable[[str, np.ndarray], None],
    ) -> None:
        self._scene = scene
        self._annotations = annotations
        self._in_volume = in_volume
        self._body_scale = body_scale
        self._on_outline = on_outline

    def markups(self, positive: bool) -> dict[str, str]:
        """The markups in the scene that are drawn to the end and can give such points: their names by their node IDs.

        Of a structure (`positive`), a closed curve is the outline, a line the diameter, and a box encloses a part; of what is
        not the structure, curves and boxes enclose a part.
        """
        kinds = [kind for kind in _LEAST_POINTS if positive or kind != _LINE]
        nodes = ((node, _LEAST_POINTS[kind]) for kind in kinds for node in nodes_of_class(self._scene, kind))
        return {
            node.GetID(): node.GetName()
            for node, least in nodes
            if not node.GetHideFromEditors() and node.GetNumberOfDefinedControlPoints() >= least
        }

    def add_region(self, id_: str, border_ras: np.ndarray, positive: bool) -> None:
        """Add points within a closed border (N, 3), RAS millimetres in one plane, to a class.

        Raises:
            InputError: it encloses no area, or no point within it lies in the volume.
        """
        points_ras = points_within_outline(border_ras, self._body_scale())
        if not len(points_ras):
            raise InputError(
                "The region encloses nothing, so no points were added. Drag a box from corner to corner, a line around a part."
            )
        self._add(id_, points_ras, positive)

    def add_outline(self, id_: str, outline_ras: np.ndarray) -> None:
        """Add points to a class whose structure ends where a closed outline goes, (N, 3) RAS millimetres in one plane.

        Those within it are positive, those around it negative.

        Raises:
            InputError: it encloses no area, or no point within it lies in the volume.
        """
        self._add_both(id_, *points_of_outline(outline_ras, self._body_scale()), what="outline")
        self._on_outline(id_, outline_ras)

    def add_diameter(self, id_: str, ends_ras: np.ndarray) -> None:
        """Add points to a class whose structure begins and ends where a line does, (2, 3) RAS millimetres.

        Those along the line are positive, those beyond its ends negative.

        Raises:
            InputError: no point along it lies in the volume, or it is too short.
        """
        self._add_both(id_, *points_of_diameter(ends_ras, self._body_scale()), what="diameter")

    def add_markup(self, id_: str, node_id: str, positive: bool) -> None:
        """Add the points of one of `markups` to a class; a curve is taken to lie in the plane nearest to it. The markup stays.

        Raises:
            InputError: none of them lies in the volume, a line is too short, or a curve encloses no area.
        """
        node = self._scene.GetNodeByID(node_id)
        if node.IsA(_LINE):
            self.add_diameter(id_, _ends(node))
        elif node.IsA(_BOX):
            self._add(id_, _points_within_box(node, self._body_scale()), positive)
        elif positive:
            self.add_outline(id_, _corners(node))
        else:
            self.add_region(id_, _corners(node), positive)

    def _add(self, id_: str, points_ras: np.ndarray, positive: bool) -> None:
        self._annotations.add_points(id_, self._within(points_ras, "region"), positive)

    def _add_both(self, id_: str, inside_ras: np.ndarray, outside_ras: np.ndarray, what: str) -> None:
        outside = outside_ras[self._in_volume(outside_ras)]
        self._annotations.add_points_of_both(id_, self._within(inside_ras, what), outside)

    def _within(self, points_ras: np.ndarray, what: str) -> np.ndarray:
        """The points (N, 3) that lie in the volume. Raises InputError where none does."""
        within = points_ras[self._in_volume(points_ras)]
        if not len(within):
            raise InputError(f"No part of the {what} lies in the volume, so no points were added. Draw it on the volume.")
        return within


def _ends(node: slicer.vtkMRMLMarkupsLineNode) -> np.ndarray:
    return np.array([node.GetNthControlPointPositionWorld(index) for index in range(2)])


def _points_within_box(node: slicer.vtkMRMLMarkupsROINode, scale: float) -> np.ndarray:
    # Its own size: the matrix has the scale of the transforms that it is under.
    return points_within_box(numpy_matrix(node.GetObjectToWorldMatrix()), np.array(node.GetSize()), scale)


def _corners(node: slicer.vtkMRMLMarkupsClosedCurveNode) -> np.ndarray:
    corners: np.ndarray = vtk_to_numpy(node.GetCurvePointsWorld().GetData()).astype(np.float64)
    return corners
