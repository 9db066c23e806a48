"""Dragging turns 3D views, also where it begins on a point of a class; in slice views it moves the point, until undo."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

import vtk

from ViTTransferFunction.Logic.scene.points_in_3d import MARKUPS_MANAGER
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import add_parameter_node
from ViTTransferFunction.Testing.support.views import Views, drag, look_from

MIDDLE_RAS = np.array([15.0, 15.0, 15.0])


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
