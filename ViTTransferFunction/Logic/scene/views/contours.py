"""Outlines of all visible classes in the slices: where their maps reach their iso values.

The iso-surfaces of all classes form one model, each in its class's colour; the slice views show its intersection.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkFlyingEdges3D

from ...core.classes.class_map import ClassMap, box_above, in_units_of
from ...core.classes.colors import Color
from ...core.volumes.geometry import Box, Geometry
from ...core.volumes.resampling import interpolated
from ...core.volumes.stepped_work import Steps
from ..mrml.derived_nodes import DerivedNodes

if TYPE_CHECKING:
    import slicer

COLOR_INDEX = "color"
"""Name of the model's point data array with indices into the table of colours."""

COLORS = 256
"""Size of the table of colours. Further classes share colours, which nobody could tell apart anyway."""

PART_VOXELS = 1 << 20
"""A surface is computed in parts of about this many voxels, which takes some hundredths of a second each."""

EDGE_VOXELS = 1e-3
"""Distance outside the map's border, in voxels, at which a surface that reaches the border is closed."""


@dataclass(frozen=True)
class OutlineStyle:
    """How outlines are drawn.

    Attributes:
        name: name of the model, as users see it.
        line_pixels: width of the lines in pixels.
        opacity: opacity of the lines, in [0, 1].
    """

    name: str
    line_pixels: int
    opacity: float = 1.0

    @property
    def colors_name(self) -> str:
        """Name of the model's table of colours."""
        return f"{self.name}, colors"


STRUCTURES = OutlineStyle("Similarity contours", line_pixels=2)


@dataclass(frozen=True, eq=False)
class ShownMap:
    """A class's map as the views show it.

    Attributes:
        class_id: id of the class.
        map: the map, in the volume's local frame. Its array must not be changed later.
        color: colour of the class.
    """

    class_id: str
    map: ClassMap
    color: Color

    def is_like(self, other: ShownMap | None) -> bool:
        """Whether both look the same. Maps count as the same only if they are one object."""
        return other is not None and self.map is other.map and self.color == other.color


Surface = list[vtkPolyData]
"""A class's iso-surface: parts that meet, in RAS millimetres."""


class Contours:
    """Shows the outlines of any number of classes in all slice views.

    Args:
        scene: where the volumes are.
        style: how the lines look.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, style: OutlineStyle = STRUCTURES) -> None:
        self._nodes = DerivedNodes(scene)
        self._style = style

    def show(self, volume_node: slicer.vtkMRMLScalarVolumeNode, outlines: Sequence[tuple[Color, Surface]]) -> None:
        """Show the outlines of these classes and no others.

        Args:
            volume_node: the volume that they are in; they move with it.
            outlines: the colours of the classes, and their surfaces.
        """
        table = {color: index % COLORS for index, color in enumerate(dict.fromkeys(color for color, _ in outlines))}
        append = vtkAppendPolyData()
        for color, surface in outlines:
            for part in surface:
                append.AddInputData(_marked(part, table[color]))
        if append.GetNumberOfInputConnections(0):
            append.Update()

        colors = self._nodes.find(self._style.colors_name) or self._add_colors()
        _set_colors(colors, table)
        model = self._nodes.find(self._style.name) or self._add_model()
        if model.GetDisplayNode() is None:
            _add_display(model, colors, self._style)
        model.GetDisplayNode().SetAndObserveColorNodeID(colors.GetID())
        was_modifying = model.StartModify()
        model.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
        model.SetAndObservePolyData(append.GetOutput())
        model.EndModify(was_modifying)
        model.GetDisplayNode().SetVisibility(True)

    def hide(self) -> None:
        """Take the outlines out of the views."""
        model = self._nodes.find(self._style.name)
        if model is not None and model.GetDisplayNode():
            model.GetDisplayNode().SetVisibility(False)

    def remove(self) -> None:
        """Take the outlines out of the scene."""
        self._nodes.remove()

    def _add_colors(self) -> Any:
        colors = self._nodes.add("vtkMRMLColorTableNode", self._style.colors_name)
        colors.SetTypeToUser()
        colors.SetNumberOfColors(COLORS)
        return colors

    def _add_model(self) -> Any:
        model = self._nodes.add("vtkMRMLModelNode", self._style.name)
        # Clicks must reach the points, not the outlines.
        model.SetSelectable(False)
        return model


def _set_colors(colors: Any, table: Mapping[Color, int]) -> None:
    was_modifying = colors.StartModify()
    for color, index in table.items():
        colors.SetColor(index, *color, 1.0)
    colors.EndModify(was_modifying)


def _add_display(model: Any, colors: Any, style: OutlineStyle) -> None:
    """Show a model as lines in the slice views and not in 3D, coloured by a table.

    Colours could also be point data, without a table, but slice views would then log an error at each update.
    """
    model.CreateDefaultDisplayNodes()
    display = model.GetDisplayNode()
    display.SetSaveWithScene(False)
    display.SetAndObserveColorNodeID(colors.GetID())
    display.SetVisibility2D(True)
    display.SetVisibility3D(False)
    display.SetSliceIntersectionThickness(style.line_pixels)
    display.SetSliceIntersectionOpacity(style.opacity)
    display.SetActiveScalar(COLOR_INDEX, vtkDataObject.POINT)
    display.SetScalarRangeFlag(display.UseColorNodeScalarRange)
    display.SetScalarVisibility(True)


def iso_surface(class_map: ClassMap) -> Steps[Surface]:
    """The surface on which a map, interpolated trilinearly, has its iso value; closed at the map's border; in steps.

    Returns:
        Triangles; none if the map exceeds its iso value nowhere.
    """
    array, surface = class_map.array, []
    box = box_above(array, class_map.iso, margin=1)
    if box is not None:
        # Only coarse maps are refined; the voxels of the others are small enough for straight edges across them.
        grid = _refined(array[box]) if array.dtype != np.uint8 else _unrefined(array[box])
        iso = in_units_of(array, class_map.iso)
        planes, rows, columns = (len(positions) for positions in grid.positions)
        thickness = max(PART_VOXELS // (rows * columns), 1)
        for start in range(0, planes - 1, thickness):
            # Parts share the plane between them, so that there is no gap.
            k = slice(start, min(start + thickness + 1, planes))
            part = _part(grid, k, iso)
            _place(part, (start, 0, 0), grid.positions, box, class_map.geometry)
            surface.append(part)
            yield thickness * rows * columns
    return surface


class _ClosedGrid(NamedTuple):
    """Values that reach to the faces of their box, between planes of zeros just outside the box.

    Attributes:
        values: (k, j, i).
        rows: for each axis, indices of the values on the planes between the first and the last, which hold zeros.
        positions: for each axis, positions of all planes, in voxels from the box's first voxel.
    """

    values: np.ndarray
    rows: list[np.ndarray]
    positions: list[np.ndarray]


def _refined(values: np.ndarray) -> _ClosedGrid:
    """With further values half-way between voxels."""
    positions = [np.arange(2 * count + 1) / 2 - 0.5 for count in values.shape]
    return _ClosedGrid(interpolated(values, positions), [np.arange(len(p)) for p in positions], _and_beyond(positions))


def _unrefined(values: np.ndarray) -> _ClosedGrid:
    """The values themselves; those of the outermost voxels also lie on the faces."""
    positions = [np.concatenate([[-0.5], np.arange(count), [count - 0.5]]) for count in values.shape]
    rows = [np.clip(np.arange(count + 2) - 1, 0, count - 1) for count in values.shape]
    return _ClosedGrid(values, rows, _and_beyond(positions))


def _and_beyond(positions: list[np.ndarray]) -> list[np.ndarray]:
    return [np.concatenate([[p[0] - EDGE_VOXELS], p, [p[-1] + EDGE_VOXELS]]) for p in positions]


def _part(grid: _ClosedGrid, k: slice, iso: float) -> vtkPolyData:
    """The surface within a range of planes k; its points are in units of planes, from the first plane of the range."""
    rows_k, rows_j, rows_i = grid.rows
    values = np.zeros((k.stop - k.start, len(rows_j) + 2, len(rows_i) + 2), dtype=grid.values.dtype)
    first, last = max(k.start, 1), min(k.stop, len(rows_k) + 1)
    inner = grid.values[rows_k[first - 1 : last - 1]][:, rows_j][:, :, rows_i]
    values[first - k.start : last - k.start, 1:-1, 1:-1] = inner
    image = vtkImageData()
    image.SetDimensions(*values.shape[::-1])
    scalars = values.ravel()
    # VTK refers to this array and does not copy it: it must live until the surface is computed.
    image.GetPointData().SetScalars(numpy_to_vtk(scalars))
    edges = vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, iso)
    edges.ComputeNormalsOff()
    edges.ComputeGradientsOff()
    edges.ComputeScalarsOff()
    edges.Update()
    return edges.GetOutput()


def _place(part: vtkPolyData, start: tuple[int, int, int], positions: list[np.ndarray], box: Box, geometry: Geometry) -> None:
    """Convert the points of a part from plane numbers (i, j, k), counted from `start` (k, j, i), to RAS millimetres."""
    planes = vtk_to_numpy(part.GetPoints().GetData())
    kji = [
        extent.start + np.interp(first + planes[:, 2 - axis], np.arange(len(position)), position)
        for axis, (first, extent, position) in enumerate(zip(start, box, positions, strict=True))
    ]
    points = vtkPoints()
    points_ras = geometry.ijk_to_ras_points(np.stack(kji[::-1], axis=1))
    points.SetData(numpy_to_vtk(points_ras.astype(np.float32), deep=True))
    part.SetPoints(points)


def _marked(mesh: vtkPolyData, index: int) -> vtkPolyData:
    """A mesh that shares points and triangles with `mesh`, and has a colour index at every point."""
    marked = vtkPolyData()
    marked.ShallowCopy(mesh)
    indices = numpy_to_vtk(np.full(mesh.GetNumberOfPoints(), index, dtype=np.uint8), deep=True)
    indices.SetName(COLOR_INDEX)
    marked.GetPointData().SetScalars(indices)
    return marked
