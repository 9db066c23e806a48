"""Fingers on a view: what the page's script makes of them is done to the view, as a mouse would do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from trame_slicer.views import SliceView
from vtkmodules.vtkCommonCore import vtkCommand

MOST_STEPS = 1000
"""Taken together: more than fingers do while the network makes them wait."""
LARGEST_FACTOR = 4.0
"""By which two fingers enlarge at a step, at most."""
_OF_ONE_FINGER = {
    "move": vtkCommand.MouseMoveEvent,
    "press": vtkCommand.LeftButtonPressEvent,
    "release": vtkCommand.LeftButtonReleaseEvent,
    "leave": vtkCommand.LeaveEvent,
}

Place = Sequence[float]
"""In shares of a view from its left and from its top."""


def put_mouse(view: Any, place: Place, keys: Sequence[bool] = (False, False, False)) -> None:
    """Have a view take the mouse to be at a place, with Ctrl, Shift and Alt held or not."""
    ctrl, shift, alt = keys
    x, y = _pixel(view, place)
    view.interactor().SetEventInformation(round(x), round(y), int(ctrl), int(shift))
    view.interactor().SetAltKey(int(alt))


def touch(view: Any, steps: Sequence[Sequence[Any]]) -> None:
    """Do to a view what fingers did.

    A finger comes from nowhere, so that a "move" to where it is goes before its "press": views place the point that follows the
    mouse. And "leave" goes after its "release", since that point has nothing left to follow.

    Args:
        view: a slice view or a 3D view.
        steps: in their order; each is "move", "press", "release" or "leave" with a place, or "spread" with the middle between
            two fingers before and after, and how many times as far apart they are after as before.
    """
    for what, *numbers in steps[:MOST_STEPS]:
        if what == "spread":
            before, after, factor = numbers
            spread = _spread_slice if isinstance(view, SliceView) else _spread_3d
            spread(view, before, after, min(max(float(factor), 1.0 / LARGEST_FACTOR), LARGEST_FACTOR))
        elif what in _OF_ONE_FINGER:
            put_mouse(view, numbers[0])
            view.interactor().InvokeEvent(_OF_ONE_FINGER[what])


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
