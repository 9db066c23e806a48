"""What mouse and fingers did in a view, which the page's scripts send as steps, is done to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from trame_slicer.views import SliceView
from vtkmodules.vtkCommonCore import vtkCommand

MOST_NOTCHES = 100
"""Of the wheel that are taken together: more than a hand turns while it waits."""
LARGEST_FACTOR = 4.0
"""By which two fingers enlarge at a step, at most."""

Place = Sequence[float]
"""In shares of a view from its left and from its top."""

_EVENTS = {
    ("hover",): vtkCommand.MouseMoveEvent,
    ("move",): vtkCommand.MouseMoveEvent,
    ("press", "left"): vtkCommand.LeftButtonPressEvent,
    ("release", "left"): vtkCommand.LeftButtonReleaseEvent,
    ("press", "middle"): vtkCommand.MiddleButtonPressEvent,
    ("release", "middle"): vtkCommand.MiddleButtonReleaseEvent,
    ("press", "right"): vtkCommand.RightButtonPressEvent,
    ("release", "right"): vtkCommand.RightButtonReleaseEvent,
    ("leave",): vtkCommand.LeaveEvent,
}


def take_steps(view: Any, steps: Sequence[Sequence[Any]]) -> None:
    """Do to a view what mouse and fingers did.

    A finger comes from nowhere, so that the page sends a "move" to where it is before its "press": views place the point that
    follows the mouse. And it sends "leave" after a finger's "release", since that point has nothing left to follow.

    Args:
        view: a slice view or a 3D view.
        steps: in their order. Each is what was done, where, with Ctrl, Shift and Alt held or not, and more: "press" and
            "release" name a button ("left", "middle" or "right"); "wheel" has its notches, away from the user, or towards them
            if negative; "spread", whose place is the middle between two fingers before it, has that after it, and how many
            times as far apart they are then; "hover" (no button is held), "move" and "leave" have no more.
    """
    for what, place, keys, *more in steps:
        _put_mouse(view, place, keys)
        if what == "wheel":
            _turn_wheel(view, *more)
        elif what == "spread":
            _spread(view, place, *more)
        else:
            name = (what, *more)
            view.interactor().InvokeEvent(_EVENTS[name])


def _put_mouse(view: Any, place: Place, keys: Sequence[bool]) -> None:
    ctrl, shift, alt = keys
    x, y = _pixel(view, place)
    view.interactor().SetEventInformation(round(x), round(y), int(ctrl), int(shift))
    view.interactor().SetAltKey(int(alt))


def _turn_wheel(view: Any, notches: int) -> None:
    event = vtkCommand.MouseWheelForwardEvent if notches > 0 else vtkCommand.MouseWheelBackwardEvent
    for _ in range(min(abs(notches), MOST_NOTCHES)):
        view.interactor().InvokeEvent(event)


def _spread(view: Any, before: Place, after: Place, factor: float) -> None:
    spread = _spread_slice if isinstance(view, SliceView) else _spread_3d
    spread(view, before, after, min(max(float(factor), 1.0 / LARGEST_FACTOR), LARGEST_FACTOR))


def _pixel(view: Any, place: Place) -> tuple[float, float]:
    """From the view's lower left."""
    width, height = view.render_window().GetSize()
    return float(place[0]) * width, (1.0 - float(place[1])) * height


def _spread_slice(view: Any, before: Place, after: Place, factor: float) -> None:
    """Move and enlarge a slice, in its plane: what was between the fingers is there again."""
    node = view.get_view_node()
    held = node.GetXYToRAS().MultiplyPoint((*_pixel(view, before), 0.0, 1.0))
    width, height, depth = node.GetFieldOfView()
    node.SetFieldOfView(width / factor, height / factor, depth)
    slipped = node.GetXYToRAS().MultiplyPoint((*_pixel(view, after), 0.0, 1.0))
    to_ras = node.GetSliceToRAS()
    for axis in range(3):
        to_ras.SetElement(axis, 3, to_ras.GetElement(axis, 3) + held[axis] - slipped[axis])
    node.UpdateMatrices()


def _spread_3d(view: Any, before: Place, after: Place, factor: float) -> None:
    """Come nearer, or go farther away."""
    view.get_camera_node().GetCamera().Dolly(factor)
    view.renderer().ResetCameraClippingRange()
    view.schedule_render()
