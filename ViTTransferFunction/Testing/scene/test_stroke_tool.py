"""The mouse in a slice view becomes points in the patient, and meanwhile the view does not react to it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.scene.stroke_tool import StrokeTool


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
    return vtk.vtkGenericRenderWindowInteractor()


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
    tool = StrokeTool(interactor, slice_node, 5.0, lambda point, continued: points.append((point[0], continued)))
    tool.activate()
    drag(interactor, (100, 50), (102, 50), (106, 50), (112, 50))
    assert [continued for _, continued in points] == [False, True, True]
    positions = np.array([point for point, _ in points])
    # In radiological convention, to the right on the screen is to the left of the patient.
    np.testing.assert_allclose(np.abs(np.diff(positions[:, 0])), [6.0, 6.0], atol=1e-6)
    np.testing.assert_allclose(positions[:, 2], 20.0)


def test_a_click_is_a_stroke_of_one_point(slice_node: Any, interactor: Any) -> None:
    points: list[np.ndarray] = []
    tool = StrokeTool(interactor, slice_node, 5.0, lambda point, continued: points.append(point))
    tool.activate()
    drag(interactor, (30, 40))
    assert len(points) == 1


def test_moving_without_a_button_leaves_nothing(slice_node: Any, interactor: Any) -> None:
    points: list[np.ndarray] = []
    tool = StrokeTool(interactor, slice_node, 5.0, lambda point, continued: points.append(point))
    tool.activate()
    mouse(interactor, "MouseMoveEvent", 10, 10)
    mouse(interactor, "MouseMoveEvent", 90, 10)
    assert points == []


def test_the_view_does_not_react_while_the_user_paints(slice_node: Any, interactor: Any) -> None:
    reactions: list[str] = []
    for event in ("LeftButtonPressEvent", "MouseMoveEvent", "LeftButtonReleaseEvent"):
        interactor.AddObserver(event, lambda caller, name: reactions.append(name), 0.0)
    tool = StrokeTool(interactor, slice_node, 5.0, lambda point, continued: None)
    tool.activate()
    drag(interactor, (10, 10), (60, 10))
    assert reactions == []
    mouse(interactor, "MouseMoveEvent", 70, 10)
    assert reactions == ["MouseMoveEvent"]
    tool.deactivate()
    drag(interactor, (10, 10), (60, 10))
    assert len(reactions) == 4
