"""Makes dragging in 3D views always turn the view, even on a point of a class; points are placed by clicks only.

Slicer's own widgets let users drag points in every view. In volume rendering, a class's points lie inside its structure, which
hides them from users but not from these widgets; and a point that is dragged in 3D jumps to the nearest visible surface. While
points are placed, these widgets take the left button, and place a point wherever it is released: a user who wants to turn the
view gets another point instead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import slicer
import vtk

from ..classes.class_nodes import is_list_of_a_class
from ..mrml.nodes import displays_of
from .view_mouse import ViewMouse

MARKUPS_MANAGER = "vtkMRMLMarkupsDisplayableManager"
"""Class of the displayable managers that show and move points in Slicer's views."""
CLICK_PIXELS = 4.0
"""During a click, the mouse moves by less than this."""
_PICK_TOLERANCE = 0.005
"""Tolerance of Slicer's own picker, as a share of the view's size."""
_PRESSES = (vtk.vtkCommand.LeftButtonPressEvent, vtk.vtkCommand.MiddleButtonPressEvent)
"""The first one grabs a point, the second one all points of a list."""


class PointsIn3D:
    """Keeps the points of classes in place when 3D views are dragged, and places points by clicks.

    Args:
        app_logic: the application's logic, which knows what is being placed.
        managers: returns the displayable managers of points of all present 3D views.
        on_nothing_hit: called instead of placing a point if the view shows nothing where the user clicks.
    """

    def __init__(
        self,
        app_logic: slicer.vtkMRMLApplicationLogic,
        managers: Callable[[], Iterable[Any]],
        on_nothing_hit: Callable[[], None],
    ) -> None:
        self._app_logic = app_logic
        self._managers = managers
        self._on_nothing_hit = on_nothing_hit
        self._clicks: dict[Any, _PlacingClicks] = {}

    def hold(self, points: slicer.vtkMRMLMarkupsNode) -> None:
        """Keep the points of a class's list in place when 3D views are dragged, and place its points by clicks only.

        Call this again whenever the list is displayed differently, because views may not have a widget for it yet, or may
        make another one. It is displayed differently when a point is under the mouse or hangs on it; by then there is a widget.
        """
        managers = list(self._managers())
        for gone in [manager for manager in self._clicks if manager not in managers]:
            self._clicks.pop(gone).close()
        for manager in managers:
            if manager not in self._clicks:
                self._clicks[manager] = _PlacingClicks(manager, self._placed_in, self._on_nothing_hit)
            for widget in filter(None, (manager.GetWidget(display) for display in displays_of(points))):
                for press in _PRESSES:
                    _ignore(widget, widget.WidgetStateOnWidget, press)
                _ignore(widget, widget.WidgetStateDefine, vtk.vtkCommand.LeftButtonPressEvent)

    def close(self) -> None:
        """Stop placing points by clicks."""
        for clicks in self._clicks.values():
            clicks.close()
        self._clicks = {}

    def _placed_in(self) -> slicer.vtkMRMLMarkupsNode | None:
        """The class's list in which points are being placed; None if there is none."""
        selection, interaction = self._app_logic.GetSelectionNode(), self._app_logic.GetInteractionNode()
        if interaction.GetCurrentInteractionMode() != slicer.vtkMRMLInteractionNode.Place:
            return None
        node = selection.GetScene().GetNodeByID(selection.GetActivePlaceNodeID() or "")
        return node if node is not None and is_list_of_a_class(node) else None


class _PlacingClicks:
    """Places points by clicks in one 3D view: the left button is released near the place where it was pressed.

    Args:
        manager: the displayable manager of the view's points.
        placed_in: returns the list in which points are being placed, or None.
        on_nothing_hit: see `PointsIn3D`.
    """

    def __init__(
        self,
        manager: Any,
        placed_in: Callable[[], slicer.vtkMRMLMarkupsNode | None],
        on_nothing_hit: Callable[[], None],
    ) -> None:
        self._view = manager.GetInteractor()
        self._renderer = manager.GetRenderer()
        self._placed_in = placed_in
        self._on_nothing_hit = on_nothing_hit
        self._pressed: tuple[float, float] | None = None
        self._mouse = ViewMouse(self._view)
        self._mouse.listen({
            vtk.vtkCommand.LeftButtonPressEvent: self._press,
            vtk.vtkCommand.MouseMoveEvent: self._move,
            vtk.vtkCommand.LeftButtonReleaseEvent: self._release,
        })  # fmt: skip

    def close(self) -> None:
        """Stop listening to the mouse."""
        self._mouse.stop()

    def _press(self) -> bool:
        self._pressed = None if self._mouse.modifiers or self._placed_in() is None else self._mouse.position
        return False

    def _move(self) -> bool:
        if self._pressed and np.hypot(*np.subtract(self._mouse.position, self._pressed)) >= CLICK_PIXELS:
            self._pressed = None
        return False

    def _release(self) -> bool:
        points = self._placed_in() if self._pressed else None
        self._pressed = None
        if points is None:
            return False
        # The view began to turn with the press, which also took the point from the mouse; the next move brings it back.
        self._view.InvokeEvent(vtk.vtkCommand.LeftButtonReleaseEvent)
        self._view.InvokeEvent(vtk.vtkCommand.MouseMoveEvent)
        if self._hits_nothing(points):
            self._on_nothing_hit()
        else:
            self._view.InvokeEvent(vtk.vtkCommand.LeftButtonReleaseEvent)
        return True

    def _hits_nothing(self, points: slicer.vtkMRMLMarkupsNode) -> bool:
        """Whether the view shows nothing at the point that hangs on the mouse.

        In that case Slicer puts the point at the depth of the camera's focal point. Something that is shown may lie at the same
        depth, such as a slice through the middle of the scan; then a picker decides, as in Slicer.
        """
        last = points.GetNumberOfControlPoints() - 1
        if last < 0 or points.GetNthControlPointPositionStatus(last) != points.PositionPreview:
            return False
        camera = self._renderer.GetActiveCamera()
        from_focus_mm = np.subtract(points.GetNthControlPointPositionWorld(last), camera.GetFocalPoint())
        depth_mm = float(np.dot(from_focus_mm, camera.GetDirectionOfProjection()))
        if abs(depth_mm) >= 1e-6 * camera.GetDistance():
            return False
        picker = vtk.vtkCellPicker()
        picker.SetTolerance(_PICK_TOLERANCE)
        return not picker.Pick(*self._mouse.position, 0.0, self._renderer)


def _ignore(widget: Any, state: int, event: int) -> None:
    """Make a widget leave an event to the view, unless a modifier key is held."""
    widget.SetEventTranslation(state, event, vtk.vtkEvent.NoModifier, widget.WidgetEventNone)
