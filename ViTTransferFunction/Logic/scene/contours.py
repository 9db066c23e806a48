"""Outlines of all visible classes over the slices: where their maps reach their iso values.

The iso-surfaces of all classes are one model, coloured by class, which the slice views cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkFlyingEdges3D

from ..core.class_map import ClassMap, box_above, in_units_of
from ..core.colors import Color
from ..core.resampling import interpolated
from .derived_nodes import DerivedNodes

if TYPE_CHECKING:
    import slicer

MODEL_NAME = "Similarity contours"
COLORS_NAME = "Similarity contour colors"

LINE_PIXELS = 2

CLASS_INDEX = "class"
"""Name of the array that says which class a point of the model is of."""

COLORS = 256

EDGE_VOXELS = 1e-3
"""How far beyond the map's border a surface that the border cuts is closed."""


@dataclass(frozen=True, eq=False)
class ShownMap:
    """A class's map as the views show it.

    Attributes:
        class_id: of the class.
        map: in the volume's local frame. Its array must not be changed later.
        color: of the class.
    """

    class_id: str
    map: ClassMap
    color: Color

    def is_like(self, other: ShownMap | None) -> bool:
        """Whether both look the same; maps are the same where they are one object."""
        return other is not None and self.map is other.map and self.color == other.color


class _Surface(NamedTuple):
    """A class's iso-surface, and the map that it was made from."""

    map: ClassMap
    mesh: vtkPolyData


class Contours:
    """Shows the outlines of any number of classes in all slice views.

    Args:
        scene: where the volumes are.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._nodes = DerivedNodes(scene)
        self._surfaces: dict[str, _Surface] = {}

    def show(self, volume_node: slicer.vtkMRMLScalarVolumeNode, shown: Sequence[ShownMap]) -> None:
        """Show the outlines of these classes and no others. Only those whose map is another one than before are computed.

        Args:
            volume_node: the volume that the maps are of; the outlines move with it.
            shown: the visible classes.
        """
        self._surfaces = {of_class.class_id: self._surface(of_class) for of_class in shown}
        append = vtkAppendPolyData()
        for index, of_class in enumerate(shown):
            append.AddInputData(_marked(self._surfaces[of_class.class_id].mesh, index))
        if shown:
            append.Update()

        colors = self._nodes.find(COLORS_NAME) or self._add_colors()
        _set_colors(colors, [of_class.color for of_class in shown])
        model = self._nodes.find(MODEL_NAME) or self._add_model()
        if model.GetDisplayNode() is None:
            _add_display(model, colors)
        model.GetDisplayNode().SetAndObserveColorNodeID(colors.GetID())
        was_modifying = model.StartModify()
        model.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
        model.SetAndObservePolyData(append.GetOutput())
        model.EndModify(was_modifying)
        model.GetDisplayNode().SetVisibility(True)

    def hide(self) -> None:
        """Take the outlines out of the views."""
        model = self._nodes.find(MODEL_NAME)
        if model is not None and model.GetDisplayNode():
            model.GetDisplayNode().SetVisibility(False)

    def remove(self) -> None:
        """Take the outlines out of the scene."""
        self._nodes.remove()
        self._surfaces.clear()

    def _surface(self, shown: ShownMap) -> _Surface:
        known = self._surfaces.get(shown.class_id)
        return known if known and known.map is shown.map else _Surface(shown.map, iso_surface(shown.map))

    def _add_colors(self) -> Any:
        colors = self._nodes.add("vtkMRMLColorTableNode", COLORS_NAME)
        colors.SetTypeToUser()
        colors.SetNumberOfColors(COLORS)
        return colors

    def _add_model(self) -> Any:
        model = self._nodes.add("vtkMRMLModelNode", MODEL_NAME)
        # Clicks are for the points.
        model.SetSelectable(False)
        return model


def _set_colors(colors: Any, classes: Sequence[Color]) -> None:
    was_modifying = colors.StartModify()
    for index, color in enumerate(classes):
        colors.SetColor(index % COLORS, *color, 1.0)
    colors.EndModify(was_modifying)


def _add_display(model: Any, colors: Any) -> None:
    """Lines in the slice views, nothing in 3D, coloured by class.

    Colours as point data would do without a table, but slice views then log an error on each update.
    """
    model.CreateDefaultDisplayNodes()
    display = model.GetDisplayNode()
    display.SetSaveWithScene(False)
    display.SetAndObserveColorNodeID(colors.GetID())
    display.SetVisibility2D(True)
    display.SetVisibility3D(False)
    display.SetSliceIntersectionThickness(LINE_PIXELS)
    display.SetActiveScalar(CLASS_INDEX, vtkDataObject.POINT)
    display.SetScalarRangeFlag(display.UseColorNodeScalarRange)
    display.SetScalarVisibility(True)


def iso_surface(class_map: ClassMap) -> vtkPolyData:
    """The surface where a map, interpolated trilinearly, has its iso value; closed at the map's border.

    Returns:
        Triangles with points in RAS millimetres; none where the map is nowhere above its iso value.
    """
    array = class_map.array
    box = box_above(array, class_map.iso, margin=1)
    if box is None:
        return vtkPolyData()
    # Only of coarse maps; the voxels of the others are small enough for straight edges across them.
    values, positions = _closed(array[box], refine=array.dtype != np.uint8)

    image = vtkImageData()
    image.SetDimensions(*values.shape[::-1])
    scalars = np.ascontiguousarray(values).ravel()
    # Referred to, not copied.
    image.GetPointData().SetScalars(numpy_to_vtk(scalars))
    edges = vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, in_units_of(array, class_map.iso))
    edges.ComputeNormalsOff()
    edges.ComputeGradientsOff()
    edges.ComputeScalarsOff()
    edges.Update()
    surface = edges.GetOutput()
    steps = vtk_to_numpy(surface.GetPoints().GetData())
    kji = [
        extent.start + np.interp(steps[:, 2 - axis], np.arange(len(position)), position)
        for axis, (extent, position) in enumerate(zip(box, positions, strict=True))
    ]
    points = vtkPoints()
    points_ras = class_map.geometry.ijk_to_ras_points(np.stack(kji[::-1], axis=1))
    points.SetData(numpy_to_vtk(points_ras.astype(np.float32), deep=True))
    surface.SetPoints(points)
    return surface


def _closed(values: np.ndarray, refine: bool) -> tuple[np.ndarray, list[np.ndarray]]:
    """Values (k, j, i) up to their box's faces, and zeros right beyond them; also half-way between voxels, if asked.

    Returns:
        The values, and where they lie along each axis, in voxels from the first.
    """
    if refine:
        positions = [np.arange(2 * count + 1) / 2 - 0.5 for count in values.shape]
        values = interpolated(values, positions)
    else:
        positions = [np.concatenate([[-0.5], np.arange(count), [count - 0.5]]) for count in values.shape]
        values = np.pad(values, 1, mode="edge")
    beyond = [np.concatenate([[p[0] - EDGE_VOXELS], p, [p[-1] + EDGE_VOXELS]]) for p in positions]
    return np.pad(values, 1), beyond


def _marked(mesh: vtkPolyData, index: int) -> vtkPolyData:
    """The mesh, sharing its points and triangles, with the class's index at every point."""
    marked = vtkPolyData()
    marked.ShallowCopy(mesh)
    indices = numpy_to_vtk(np.full(mesh.GetNumberOfPoints(), index % COLORS, dtype=np.uint8), deep=True)
    indices.SetName(CLASS_INDEX)
    marked.GetPointData().SetScalars(indices)
    return marked
