"""Dragging turns 3D views, also where it begins on a point of a class or while points are placed; in slices it moves points."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

import slicer
import vtk

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.tools.place_mode import PlaceMode
from ViTTransferFunction.Logic.scene.tools.points_in_3d import MARKUPS_MANAGER
from ViTTransferFunction.Testing.support.scenes import add_parameter_node
from ViTTransferFunction.Testing.support.views import Views, click, drag, look_from, pixels

MIDDLE_RAS = np.array([15.0, 15.0, 15.0])
NOTHING_RAS = np.array([35.0, 15.0, 35.0])
"""Where 3D views show nothing."""


@pytest.fixture
def views(slicer_app: Any) -> Views:
    return Views(slicer_app)


@pytest.fixture
def view_3d(views: Views) -> Any:
    view = views.view_3d()
    look_from(view, MIDDLE_RAS, 100.0)
    return view


@pytest.fixture
def session(views: Views, view_3d: Any) -> Iterator[SceneSession]:
    """A session with a class that has a point on it and one off it."""
    managers = [view_3d.get_displayable_manager_by_class(MARKUPS_MANAGER)]
    session = SceneSession(views.scene, views.app_logic, add_parameter_node(views.scene), points_3d=lambda: managers)
    id_ = session.annotations.add_class().id
    session.annotations.add_points(id_, MIDDLE_RAS[None], positive=True)
    session.annotations.add_points(id_, MIDDLE_RAS[None] + [[8.0, 0.0, 8.0]], positive=False)
    yield session
    session.close()


def points(session: SceneSession) -> tuple[Any, Any]:
    return session.classes[0].positive, session.classes[0].negative


def test_a_3d_view_is_turned_by_a_drag_that_begins_on_a_point(session: SceneSession, view_3d: Any) -> None:
    before = points(session)
    for (point_ras,) in before:
        camera = view_3d.get_camera_node().GetPosition()
        drag(view_3d, point_ras)
        assert points(session) == before
        assert view_3d.get_camera_node().GetPosition() != camera


def test_the_middle_button_moves_the_view_and_not_all_points_of_a_class(session: SceneSession, view_3d: Any) -> None:
    before, camera = points(session), view_3d.get_camera_node().GetPosition()
    drag(view_3d, MIDDLE_RAS, "Middle")
    assert points(session) == before
    assert view_3d.get_camera_node().GetPosition() != camera


def test_points_of_a_saved_scene_stay_where_they_are_as_well(
    session: SceneSession, view_3d: Any, views: Views, tmp_path: Any
) -> None:
    before = points(session)
    assert views.scene.WriteToMRB(str(tmp_path / "tomorrow.mrb"))
    views.scene.Clear(False)
    assert views.scene.ReadFromMRB(str(tmp_path / "tomorrow.mrb"))
    look_from(view_3d, MIDDLE_RAS, 100.0)
    drag(view_3d, MIDDLE_RAS)
    assert points(session) == before


def test_a_point_of_somebody_else_is_dragged_as_ever(session: SceneSession, view_3d: Any, views: Views) -> None:
    node = views.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    node.CreateDefaultDisplayNodes()
    node.AddControlPointWorld(vtk.vtkVector3d(*(MIDDLE_RAS - [10.0, 0.0, 10.0])))
    drag(view_3d, MIDDLE_RAS - [10.0, 0.0, 10.0])
    moved = np.array(node.GetNthControlPointPositionWorld(0))
    assert np.linalg.norm(moved - (MIDDLE_RAS - [10.0, 0.0, 10.0])) > 1.0


def test_a_point_that_was_dragged_by_mistake_in_a_slice_view_is_brought_back_by_undo(
    session: SceneSession, views: Views
) -> None:
    view, before = views.slice_view(), points(session)
    drag(view, MIDDLE_RAS)
    assert np.linalg.norm(np.array(session.classes[0].positive[0]) - MIDDLE_RAS) > 1.0
    session.annotations.undo()
    assert points(session) == before


@pytest.fixture
def placing(session: SceneSession, views: Views) -> Iterator[SceneSession]:
    """Points are being placed on the class, of which there is something to be seen: a ball around the middle."""
    ball = vtk.vtkSphereSource()
    ball.SetCenter(*MIDDLE_RAS)
    ball.SetRadius(5.0)
    ball.Update()
    model = views.scene.AddNewNodeByClass("vtkMRMLModelNode")
    model.SetAndObservePolyData(ball.GetOutput())
    model.CreateDefaultDisplayNodes()
    place_mode = PlaceMode(views.app_logic, lambda: None)
    place_mode.start(session.annotations.points_node(session.classes[0].id, True))
    yield session
    place_mode.stop()


@pytest.mark.parametrize("begin_ras", [MIDDLE_RAS, NOTHING_RAS])
def test_while_points_are_placed_a_3d_view_is_turned_by_a_drag_and_no_point_is_added(
    placing: SceneSession, view_3d: Any, begin_ras: np.ndarray
) -> None:
    before, camera = points(placing), view_3d.get_camera_node().GetPosition()
    drag(view_3d, begin_ras)
    assert points(placing) == before
    assert view_3d.get_camera_node().GetPosition() != camera


@pytest.mark.parametrize("shaking", [False, True])
def test_each_click_on_what_a_3d_view_shows_places_a_point_there(placing: SceneSession, view_3d: Any, shaking: bool) -> None:
    for number in range(2):
        click(view_3d, MIDDLE_RAS + np.array([2.0 * number, 0.0, 2.0]), shaking)
        assert len(placing.classes[0].positive) == 2 + number
        assert np.linalg.norm(np.array(placing.classes[0].positive[-1]) - MIDDLE_RAS) == pytest.approx(5.0, abs=0.5)
    drag(view_3d, MIDDLE_RAS)
    assert len(placing.classes[0].positive) == 3


def test_a_click_on_nothing_in_a_3d_view_places_no_point_and_is_told_each_time(placing: SceneSession, view_3d: Any) -> None:
    before = points(placing)
    for _ in range(2):
        click(view_3d, NOTHING_RAS)
        assert points(placing) == before
        assert "Nothing is shown there" in (placing.take_error() or "")
    click(view_3d, MIDDLE_RAS + np.array([0.0, 0.0, 2.0]))
    assert len(placing.classes[0].positive) == len(before[0]) + 1
    assert placing.errors == ()


def test_what_a_3d_view_shows_as_deep_as_its_focus_is_clicked_on_as_all_else(
    placing: SceneSession, view_3d: Any, views: Views
) -> None:
    """Such as the slice through the middle of a scan."""
    x, y, z = NOTHING_RAS.tolist()
    plane = vtk.vtkPlaneSource()
    plane.SetOrigin(x - 5.0, y, z - 5.0)
    plane.SetPoint1(x + 5.0, y, z - 5.0)
    plane.SetPoint2(x - 5.0, y, z + 5.0)
    plane.Update()
    model = views.scene.AddNewNodeByClass("vtkMRMLModelNode", "slice")
    model.SetAndObservePolyData(plane.GetOutput())
    model.CreateDefaultDisplayNodes()
    pixels(view_3d)
    click(view_3d, NOTHING_RAS)
    assert placing.take_error() is None
    np.testing.assert_allclose(placing.classes[0].positive[-1], NOTHING_RAS, atol=0.3)


@pytest.mark.parametrize("key", ["ctrl", "shift"])
def test_a_click_with_a_key_held_places_no_point_in_a_3d_view(placing: SceneSession, view_3d: Any, key: str) -> None:
    before = points(placing)
    for place_ras in (MIDDLE_RAS + np.array([0.0, 0.0, 2.0]), NOTHING_RAS):
        click(view_3d, place_ras, ctrl=key == "ctrl", shift=key == "shift")
        assert (points(placing), placing.take_error()) == (before, None)


def test_points_of_somebody_else_are_placed_as_ever(session: SceneSession, view_3d: Any, views: Views) -> None:
    node = views.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    node.CreateDefaultDisplayNodes()
    views.app_logic.GetSelectionNode().SetReferenceActivePlaceNodeClassName("vtkMRMLMarkupsFiducialNode")
    views.app_logic.GetSelectionNode().SetActivePlaceNodeID(node.GetID())
    views.app_logic.GetInteractionNode().SetCurrentInteractionMode(slicer.vtkMRMLInteractionNode.Place)
    pixels(view_3d)
    click(view_3d, NOTHING_RAS)
    assert node.GetNumberOfDefinedControlPoints() == 1


def test_a_click_in_a_slice_view_places_a_point_as_ever(placing: SceneSession, views: Views) -> None:
    place_ras = MIDDLE_RAS + np.array([4.0, 4.0, 0.0])
    click(views.slice_view(), place_ras)
    np.testing.assert_allclose(placing.classes[0].positive[-1], place_ras, atol=0.3)


def test_a_double_click_in_a_3d_view_ends_placing_as_in_slice_views(placing: SceneSession, view_3d: Any, views: Views) -> None:
    click(view_3d, MIDDLE_RAS)
    view_3d.interactor().InvokeEvent(vtk.vtkCommand.LeftButtonDoubleClickEvent)
    view_3d.interactor().InvokeEvent(vtk.vtkCommand.LeftButtonReleaseEvent)
    assert views.app_logic.GetInteractionNode().GetCurrentInteractionMode() == slicer.vtkMRMLInteractionNode.ViewTransform
    assert len(placing.classes[0].positive) == 2
