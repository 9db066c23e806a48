"""In 3D views, dragging turns the view, also where it begins on a point of a class: points are dragged in slice views.

Slicer's own widgets have points dragged in every view. A class's points lie within what volume rendering shows of it, which
hides them from users, but not from these widgets; and a point that is dragged in 3D jumps to the nearest visible surface.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import slicer
import vtk

from .nodes import displays_of

MARKUPS_MANAGER = "vtkMRMLMarkupsDisplayableManager"
"""What shows points in a view of Slicer's, and moves them."""
_PRESSES = (vtk.vtkCommand.LeftButtonPressEvent, vtk.vtkCommand.MiddleButtonPressEvent)
"""The first one takes hold of a point, the second one of all points of a list."""


def hold_in_3d(points: slicer.vtkMRMLMarkupsNode, managers: Iterable[Any]) -> None:
    """Have the points of a list stay where they are when 3D views are dragged.

    Args:
        points: the list. Views may not have a widget for it yet, or make another one later: this is to be called again
            whenever it is displayed otherwise, as it is when a point is pointed at. By then the widget is there.
        managers: of points, of the 3D views.
    """
    widgets = (manager.GetWidget(display) for manager in managers for display in displays_of(points))
    for widget in filter(None, widgets):
        for press in _PRESSES:
            widget.SetEventTranslation(widget.WidgetStateOnWidget, press, vtk.vtkEvent.NoModifier, widget.WidgetEventNone)
