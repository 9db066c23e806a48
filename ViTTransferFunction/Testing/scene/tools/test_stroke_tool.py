"""The mouse in a slice view becomes points in the patient, and meanwhile the view does not react to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.scene.tools.brush_circle import COLOR
from ViTTransferFunction.Logic.scene.tools.stroke_tool import StrokeTool
from ViTTransferFunction.Testing.support.views import SLICE_PIXELS, Views, pixels


@pytest.fixture
def slice_node(slicer_app: Any) -> Any:
    """An axial slice at S = 20 mm, 1 mm a pixel, R = A = 0 in the middle of 200×100 pixels."""
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLSliceNode")
    node.SetLayoutName("Red")
    node.SetOrientation("Axial")
    node.SetDimensions(200, 100, 1)
    node.SetFieldOfView(200.0, 100.0, 1.0)
    node.JumpSliceByOffsetting(0.0, 0.0, 20.0)
    node.UpdateMatrices()
    return node


@pytest.fixture
def interactor() -> Any:
    interactor = vtk.vtkGenericRenderWindowInteractor()
    window = vtk.vtkRenderWindow()
    window.AddRenderer(vtk.vtkRenderer())
    interactor.SetRenderWindow(window)
    interactor.SetInteractorStyle(vtk.vtkInteractorStyleUser())
    return interactor


def tool_in(
    interactor: Any, slice_node: Any, on_point: Callable[[np.ndarray, bool], None], radius_mm: float = 5.0
) -> StrokeTool:
    """A tool that leaves a point every 5 mm, active."""
    tool = StrokeTool(interactor, slice_node, lambda: None, 5.0, radius_mm, on_point)
    tool.activate()
    return tool


def mouse(interactor: Any, event: str, x: int, y: int) -> None:
    interactor.SetEventInformation(x, y, 0, 0)
    interactor.InvokeEvent(event)


def drag(interactor: Any, *positions: tuple[int, int]) -> None:
    mouse(interactor, "LeftButtonPressEvent", *positions[0])
    for position in positions[1:]:
        mouse(interactor, "MouseMoveEvent", *position)
    mouse(interactor, "LeftButtonReleaseEvent", *positions[-1])


def test_a_stroke_leaves_points_along_its_way(slice_node: Any, interactor: Any) -> None:
    points: list[tuple[np.ndarray, bool]] = []
    tool_in(interactor, slice_node, lambda point, continued: points.append((point[0], continued)))
    drag(interactor, (100, 50), (102, 50), (106, 50), (112, 50))
    assert [continued for _, continued in points] == [False, True, True]
    positions = np.array([point for point, _ in points])
    # In radiological convention, to the right on the screen is to the left of the patient.
    np.testing.assert_allclose(np.abs(np.diff(positions[:, 0])), [6.0, 6.0], atol=1e-6)
    np.testing.assert_allclose(positions[:, 2], 20.0)


def test_a_click_is_a_stroke_of_one_point(slice_node: Any, interactor: Any) -> None:
    points: list[np.ndarray] = []
    tool_in(interactor, slice_node, lambda point, continued: points.append(point))
    drag(interactor, (30, 40))
    assert len(points) == 1


def test_the_second_press_of_a_double_click_is_a_stroke_as_well(slice_node: Any, interactor: Any) -> None:
    """Qt says so of it, and not that the button is pressed; a view that hears of it fills the window with itself."""
    points: list[bool] = []
    reached = []
    interactor.AddObserver("LeftButtonDoubleClickEvent", lambda *_: reached.append(1))
    tool_in(interactor, slice_node, lambda point, continued: points.append(continued))
    drag(interactor, (30, 40))
    mouse(interactor, "LeftButtonDoubleClickEvent", 30, 40)
    mouse(interactor, "MouseMoveEvent", 60, 40)
    mouse(interactor, "LeftButtonReleaseEvent", 60, 40)
    assert points == [False, False, True]
    assert not reached


@pytest.mark.parametrize("key", ["Control", "Shift", "Alt"])
def test_what_is_dragged_with_a_key_held_is_the_views(slice_node: Any, interactor: Any, key: str) -> None:
    """Shift pans, Ctrl blends: with a brush in hand as without."""
    points: list[np.ndarray] = []
    reached = []
    tool_in(interactor, slice_node, lambda point, continued: points.append(point))
    events = ("LeftButtonPressEvent", "MouseMoveEvent", "LeftButtonReleaseEvent")
    for event in events:
        interactor.AddObserver(event, lambda caller, event: reached.append(event))
    getattr(interactor, f"Set{key}Key")(1)
    for event, x in zip(events, (30, 60, 60), strict=True):
        interactor.SetEventPosition(x, 40)
        interactor.InvokeEvent(event)
    assert reached == list(events)
    assert not points


def test_moving_without_a_button_leaves_nothing(slice_node: Any, interactor: Any) -> None:
    points: list[np.ndarray] = []
    tool_in(interactor, slice_node, lambda point, continued: points.append(point))
    mouse(interactor, "MouseMoveEvent", 10, 10)
    mouse(interactor, "MouseMoveEvent", 90, 10)
    assert points == []


def test_a_stroke_is_over_where_the_button_was_released_elsewhere_as_in_a_message_that_came_up(
    slice_node: Any, interactor: Any
) -> None:
    """With a button held, a mouse enters no view."""
    points: list[np.ndarray] = []
    tool_in(interactor, slice_node, lambda point, continued: points.append(point))
    mouse(interactor, "LeftButtonPressEvent", 10, 10)
    interactor.InvokeEvent("LeaveEvent")
    interactor.InvokeEvent("EnterEvent")
    mouse(interactor, "MouseMoveEvent", 90, 10)
    assert len(points) == 1


def test_the_view_does_not_react_while_the_user_paints(slice_node: Any, interactor: Any) -> None:
    reactions: list[str] = []
    for event in ("LeftButtonPressEvent", "MouseMoveEvent", "LeftButtonReleaseEvent"):
        interactor.AddObserver(event, lambda caller, name: reactions.append(name), 0.0)
    tool = tool_in(interactor, slice_node, lambda point, continued: None)
    drag(interactor, (10, 10), (60, 10))
    assert reactions == []
    mouse(interactor, "MouseMoveEvent", 70, 10)
    assert reactions == ["MouseMoveEvent"]
    tool.deactivate()
    drag(interactor, (10, 10), (60, 10))
    assert len(reactions) == 4


def test_a_slice_view_has_one_slice_so_that_its_pixels_say_where_it_is(slice_node: Any) -> None:
    # Slicer had light boxes, several slices in one view, up to 5.8.
    slice_node.SetLayoutGrid(2, 3)
    assert (slice_node.GetLayoutGridRows(), slice_node.GetLayoutGridColumns()) == (1, 1)


@pytest.fixture
def view(slicer_app: Any) -> Any:
    return Views(slicer_app).slice_view()


def circle_in(view: Any) -> np.ndarray:
    """Distances in pixels of the circle's pixels from the middle of the view; none where there is no circle."""
    yellow = np.abs(pixels(view) - 255 * np.array(COLOR)).max(axis=2) < 40
    return np.linalg.norm(np.argwhere(yellow) - SLICE_PIXELS // 2, axis=1)


def to_the_middle(view: Any) -> None:
    mouse(view.interactor(), "MouseMoveEvent", SLICE_PIXELS // 2, SLICE_PIXELS // 2)


@pytest.mark.parametrize("radius_mm", [4.0, 9.0])
def test_a_circle_of_the_brushs_size_follows_the_mouse(view: Any, radius_mm: float) -> None:
    before = pixels(view)
    tool = tool_in(view.interactor(), view.get_view_node(), lambda point, continued: None, radius_mm)
    np.testing.assert_array_equal(pixels(view), before)
    to_the_middle(view)
    pixels_per_mm = SLICE_PIXELS / view.get_view_node().GetFieldOfView()[0]
    distances = circle_in(view)
    assert len(distances) > 4 * radius_mm * pixels_per_mm
    np.testing.assert_allclose(distances, radius_mm * pixels_per_mm, atol=2.0)
    mouse(view.interactor(), "MouseMoveEvent", SLICE_PIXELS // 2 + 30, SLICE_PIXELS // 2)
    assert np.ptp(circle_in(view)) > 40
    tool.deactivate()
    np.testing.assert_array_equal(pixels(view), before)


def test_the_circle_keeps_its_size_in_millimetres_when_the_view_is_zoomed(view: Any) -> None:
    tool_in(view.interactor(), view.get_view_node(), lambda point, continued: None)
    to_the_middle(view)
    small = circle_in(view).mean()
    node = view.get_view_node()
    node.SetFieldOfView(*np.array(node.GetFieldOfView()) / [2.0, 2.0, 1.0])
    assert circle_in(view).mean() == pytest.approx(2.0 * small, abs=2.0)


def test_the_circle_is_gone_while_the_mouse_is_elsewhere(view: Any) -> None:
    tool_in(view.interactor(), view.get_view_node(), lambda point, continued: None)
    to_the_middle(view)
    mouse(view.interactor(), "LeaveEvent", 0, SLICE_PIXELS // 2)
    assert not len(circle_in(view))
    to_the_middle(view)
    assert len(circle_in(view))


def test_the_view_is_drawn_again_whenever_the_circle_changes(slice_node: Any, interactor: Any) -> None:
    drawn: list[str] = []
    tool = StrokeTool(interactor, slice_node, lambda: drawn.append(""), 5.0, 5.0, lambda point, continued: None)
    tool.activate()
    mouse(interactor, "MouseMoveEvent", 10, 10)
    mouse(interactor, "LeaveEvent", 0, 10)
    tool.deactivate()
    assert len(drawn) == 3
