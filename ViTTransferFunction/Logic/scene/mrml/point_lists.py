"""Lists of points, as Slicer's Markups keep them: where points were placed, and what else users may say of each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from difflib import SequenceMatcher
from typing import Any

import slicer
import vtk

Point = tuple[float, float, float]
"""R, A and S in millimetres."""

PropertiesByPoint = Mapping[Point, tuple[Any, ...]]
"""For each point, what `_PROPERTIES` names."""

_PROPERTIES = ("Label", "Description", "Locked", "Selected", "Visibility")
"""What Slicer's table of points shows of each, beside its place."""


def defined_points(node: slicer.vtkMRMLMarkupsNode) -> tuple[Point, ...]:
    """World positions of the control points that were placed, RAS millimetres; not of one that still hangs on the mouse."""
    return tuple(_position(node, index) for index in _defined(node))


def points_and_properties(node: slicer.vtkMRMLMarkupsNode) -> tuple[tuple[Point, ...], PropertiesByPoint]:
    """`defined_points`, and what users may say of them, by their place; of several in one place the last."""
    read = [getattr(node, f"GetNthControlPoint{name}") for name in _PROPERTIES]
    placed = [(_position(node, index), tuple(get(index) for get in read)) for index in _defined(node)]
    return tuple(point for point, _ in placed), dict(placed)


def index_of_new_point(node: slicer.vtkMRMLMarkupsNode, known: Collection[Point]) -> int | None:
    """Which control point was placed, and is none of the known ones: the last such one; None where there is none.

    Most often it is the list's last; but where users unset points, Slicer has these placed anew first.
    """
    placed = (index for index in reversed(range(node.GetNumberOfControlPoints())) if _is_defined(node, index))
    return next((index for index in placed if _position(node, index) not in known), None)


def set_points(node: slicer.vtkMRMLMarkupsNode, points: tuple[Point, ...], properties: PropertiesByPoint) -> None:
    """Bring the placed points to these.

    Args:
        node: those of its points that stay, or move, keep their properties.
        points: world positions, RAS millimetres.
        properties: of points that are not there yet; one that has none gets a label from Slicer, at the list's end.
    """
    # Slicer draws all points anew for each that comes or goes, but once where they do so together.
    was_modifying = node.StartModify()
    was_fixed = node.GetFixedNumberOfControlPoints()
    node.SetFixedNumberOfControlPoints(False)  # The lock of Slicer's table of points, against clicks by mistake.
    _remove_unplaced(node)
    steps = SequenceMatcher(None, defined_points(node), points, autojunk=False).get_opcodes()
    # The last ones first, so that indices stay.
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
    """Put a point before the one of this index, or after the last one."""
    if index < node.GetNumberOfControlPoints():
        node.InsertControlPointWorld(index, vtk.vtkVector3d(*point))
    else:
        node.AddControlPointWorld(vtk.vtkVector3d(*point))
    for name, value in zip(_PROPERTIES, properties, strict=False):
        getattr(node, f"SetNthControlPoint{name}")(index, value)


def _remove_unplaced(node: slicer.vtkMRMLMarkupsNode) -> None:
    """One still hangs on the mouse, say."""
    for index in reversed(range(node.GetNumberOfControlPoints())):
        if not _is_defined(node, index):
            node.RemoveNthControlPoint(index)
