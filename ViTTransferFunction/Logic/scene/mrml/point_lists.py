"""Slicer's lists of points: their positions, and the properties of each point that users can set."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from difflib import SequenceMatcher
from typing import Any

import slicer
import vtk

Point = tuple[float, float, float]
"""Coordinates R, A and S in millimetres."""

PropertiesByPoint = Mapping[Point, tuple[Any, ...]]
"""For each point, the values of `_PROPERTIES`."""

_PROPERTIES = ("Label", "Description", "Locked", "Selected", "Visibility")
"""Properties of a point, beside its position, in Slicer's table of points."""


def defined_points(node: slicer.vtkMRMLMarkupsNode) -> tuple[Point, ...]:
    """World positions of the points that have been placed, RAS millimetres; not of one that hangs on the mouse."""
    return tuple(_position(node, index) for index in _defined(node))


def points_and_properties(node: slicer.vtkMRMLMarkupsNode) -> tuple[tuple[Point, ...], PropertiesByPoint]:
    """`defined_points`, and their properties by position; of several points at one position, those of the last."""
    read = [getattr(node, f"GetNthControlPoint{name}") for name in _PROPERTIES]
    placed = [(_position(node, index), tuple(get(index) for get in read)) for index in _defined(node)]
    return tuple(point for point, _ in placed), dict(placed)


def index_of_new_point(node: slicer.vtkMRMLMarkupsNode, known: Collection[Point]) -> int | None:
    """Index of the last placed point that is not a known one; None if there is none.

    It is usually the last point of the list, but if users have unset points, Slicer places these again first.
    """
    placed = (index for index in reversed(range(node.GetNumberOfControlPoints())) if _is_defined(node, index))
    return next((index for index in placed if _position(node, index) not in known), None)


def set_points(node: slicer.vtkMRMLMarkupsNode, points: tuple[Point, ...], properties: PropertiesByPoint) -> None:
    """Replace the placed points of a list by these; points that are in both stay.

    Args:
        node: the list; points that stay or move keep their properties.
        points: world positions, RAS millimetres.
        properties: properties of new points; a point without any gets a label from Slicer if it is added at the end.
    """
    # As one modification, because Slicer would otherwise redraw all points for each that is added or removed.
    was_modifying = node.StartModify()
    was_fixed = node.GetFixedNumberOfControlPoints()
    node.SetFixedNumberOfControlPoints(False)  # Opens the lock of Slicer's table of points, which prevents accidental clicks.
    _remove_unplaced(node)
    steps = SequenceMatcher(None, defined_points(node), points, autojunk=False).get_opcodes()
    # From the end, so that earlier indices stay valid.
    for step, start, stop, first, last in reversed(steps):
        if step != "equal":
            moved = min(stop - start, last - first)
            for index in range(moved):
                node.SetNthControlPointPositionWorld(start + index, points[first + index])
            for index in reversed(range(start + moved, stop)):
                node.RemoveNthControlPoint(index)
            for index in range(moved, last - first):
                point = points[first + index]
                _place(node, start + index, point, properties.get(point, ()))
    node.SetFixedNumberOfControlPoints(was_fixed)
    node.EndModify(was_modifying)


def _defined(node: slicer.vtkMRMLMarkupsNode) -> Iterator[int]:
    return (index for index in range(node.GetNumberOfControlPoints()) if _is_defined(node, index))


def _is_defined(node: slicer.vtkMRMLMarkupsNode, index: int) -> bool:
    return bool(node.GetNthControlPointPositionStatus(index) == slicer.vtkMRMLMarkupsNode.PositionDefined)


def _position(node: slicer.vtkMRMLMarkupsNode, index: int) -> Point:
    x, y, z = node.GetNthControlPointPositionWorld(index)
    return x, y, z


def _place(node: slicer.vtkMRMLMarkupsNode, index: int, point: Point, properties: tuple[Any, ...]) -> None:
    """Insert a point before the one with this index, or add it at the end."""
    if index < node.GetNumberOfControlPoints():
        node.InsertControlPointWorld(index, vtk.vtkVector3d(*point))
    else:
        node.AddControlPointWorld(vtk.vtkVector3d(*point))
    for name, value in zip(_PROPERTIES, properties, strict=False):
        getattr(node, f"SetNthControlPoint{name}")(index, value)


def _remove_unplaced(node: slicer.vtkMRMLMarkupsNode) -> None:
    """Remove points without a position, such as one that hangs on the mouse."""
    for index in reversed(range(node.GetNumberOfControlPoints())):
        if not _is_defined(node, index):
            node.RemoveNthControlPoint(index)
