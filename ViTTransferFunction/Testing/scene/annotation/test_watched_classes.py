"""What users do to points and lists in views and other modules of Slicer, and the steps that undo takes back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.scene.annotation.annotations import SceneAnnotations
from ViTTransferFunction.Logic.scene.classes.class_nodes import class_nodes
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import add_hanging_point, add_parameter_node, annotate, open_spheres, put_under
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


@pytest.fixture
def session(session_without_volume: SceneSession) -> SceneSession:
    return session_without_volume


def test_each_placed_point_is_a_step_of_its_own(session: SceneSession, spheres: Spheres) -> None:
    state = session.annotations.add_class("sphere")
    node = session.annotations.points_node(state.id, positive=True)
    for label in (1, 2, 3):
        node.AddControlPointWorld(vtk.vtkVector3d(*centre_ras(spheres, label)[0]))
    for left in (2, 1, 0):
        session.annotations.undo()
        assert len(session.classes[0].positive) == left
    session.annotations.redo()
    assert len(session.classes[0].positive) == 1


def test_a_point_that_hangs_on_the_mouse_is_heard_of_once_when_it_is_placed(slicer_app: Any) -> None:
    heard: list[int] = []
    classes = SceneAnnotations(
        slicer_app.scene,
        add_parameter_node(slicer_app.scene),
        lambda: heard.append(len(classes.classes[0].positive)),
        settle=lambda point_ras: point_ras + 1.0,
    )
    state = classes.add_class("liver")
    classes.add_points(state.id, np.zeros((1, 3)), positive=True)
    node = classes.points_node(state.id, positive=True)
    index = add_hanging_point(slicer_app.scene, node)
    heard.clear()
    node.SetNthControlPointPositionWorld(index, 6.0, 0.0, 0.0, node.PositionPreview)
    assert heard == []
    node.SetNthControlPointPositionWorld(index, 7.0, 0.0, 0.0)
    assert heard == [2]
    assert classes.classes[0].positive == ((0.0, 0.0, 0.0), (8.0, 1.0, 1.0))
    classes.close()


def test_undo_and_redo_are_heard_of_once_each(slicer_app: Any) -> None:
    heard: list[int] = []
    classes = SceneAnnotations(
        slicer_app.scene, add_parameter_node(slicer_app.scene), lambda: heard.append(len(classes.classes[0].positive))
    )
    state = classes.add_class("liver")
    classes.add_points(state.id, np.zeros((1, 3)), positive=True)
    heard.clear()
    classes.undo()
    classes.redo()
    assert heard == [0, 1]
    classes.close()


def test_coordinates_that_are_typed_into_slicers_table_count_and_can_be_undone(session: SceneSession) -> None:
    state = session.annotations.add_class("liver")
    session.annotations.add_points(state.id, np.zeros((1, 3)), positive=True)
    node = session.annotations.points_node(state.id, positive=True)
    for typed in ((1.0, 0.0, 0.0), (1.0, 2.0, 0.0), (1.0, 2.0, 3.0)):
        node.SetNthControlPointPositionWorld(0, *typed)
        assert session.classes[0].positive == (typed,)
    session.annotations.undo()
    assert session.classes[0].positive == ((0.0, 0.0, 0.0),)


def test_points_that_are_unset_and_restored_in_slicers_table_go_and_come_back_by_steps(session: SceneSession) -> None:
    state = session.annotations.add_class("liver")
    node = session.annotations.points_node(state.id, positive=True)
    for x in (0.0, 10.0, 20.0):
        node.AddControlPointWorld(vtk.vtkVector3d(x, 0.0, 0.0))
    node.UnsetNthControlPointPosition(0)
    node.SetNthControlPointPositionMissing(1)
    assert [point[0] for point in session.classes[0].positive] == [20.0]
    node.SetNthControlPointPositionWorld(2, 21.0, 0.0, 0.0)
    assert [point[0] for point in session.classes[0].positive] == [21.0]
    node.RestoreNthControlPointPosition(1)
    assert [point[0] for point in session.classes[0].positive] == [10.0, 21.0]
    for left in ([21.0], [20.0], [10.0, 20.0], [0.0, 10.0, 20.0]):
        session.annotations.undo()
        assert [point[0] for point in session.classes[0].positive] == left


@pytest.mark.parametrize("hangs", [True, False], ids=["by the mouse", "at once"])
def test_a_point_that_was_unset_is_placed_anew_in_one_step_and_the_others_stay(slicer_app: Any, hangs: bool) -> None:
    annotations = SceneAnnotations(
        slicer_app.scene, add_parameter_node(slicer_app.scene), lambda: None, settle=lambda point_ras: point_ras + 1.0
    )
    state = annotations.add_class("liver")
    annotations.add_points(state.id, np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]), positive=True)
    node = annotations.points_node(state.id, positive=True)
    node.UnsetNthControlPointPosition(0)
    if hangs:
        node.SetNthControlPointPositionWorld(0, 3.0, 0.0, 0.0, node.PositionPreview)
        assert annotations.classes[0].positive == ((10.0, 0.0, 0.0),)
    node.SetNthControlPointPositionWorld(0, 5.0, 0.0, 0.0)
    assert annotations.classes[0].positive == ((6.0, 1.0, 1.0), (10.0, 0.0, 0.0))
    annotations.undo()
    assert annotations.classes[0].positive == ((10.0, 0.0, 0.0),)
    annotations.close()


def table(node: Any) -> list[tuple[str, str, bool, bool, bool]]:
    """What Slicer's table of points shows beside coordinates."""
    return [
        (
            node.GetNthControlPointLabel(n),
            node.GetNthControlPointDescription(n),
            node.GetNthControlPointLocked(n),
            node.GetNthControlPointSelected(n),
            node.GetNthControlPointVisibility(n),
        )
        for n in range(node.GetNumberOfControlPoints())
    ]


def describe_points(node: Any) -> None:
    for n, label in enumerate(("dome", "hilum", "tip")):
        node.SetNthControlPointLabel(n, label)
        node.SetNthControlPointDescription(n, f"the {label}")
    node.SetNthControlPointLocked(1, True)
    node.SetNthControlPointSelected(1, False)
    node.SetNthControlPointVisibility(1, False)


@pytest.mark.parametrize("positive", [True, False])
def test_points_that_come_back_in_the_middle_of_a_list_are_what_they_were_in_slicers_table(
    session: SceneSession, positive: bool
) -> None:
    state = session.annotations.add_class("liver")
    node = session.annotations.points_node(state.id, positive)
    for x in (0.0, 10.0, 20.0):
        session.annotations.add_points(state.id, np.array([[x, 0.0, 0.0]]), positive)
    describe_points(node)
    before = table(node)
    node.RemoveNthControlPoint(1)
    session.annotations.erase_points(np.array([[0.0, 0.0, 0.0]]), radius_mm=1.0)
    assert table(node) == before[2:]
    session.annotations.undo()
    session.annotations.undo()
    assert table(node) == before
    # What is said of a point after it came back counts from then on.
    node.SetNthControlPointLabel(1, "porta")
    node.RemoveNthControlPoint(1)
    session.annotations.undo()
    assert [row[0] for row in table(node)] == ["dome", "porta", "tip"]


def test_the_points_of_a_structure_that_comes_back_are_what_they_were_in_slicers_table(session: SceneSession) -> None:
    state = session.annotations.add_class("liver")
    session.annotations.add_points(state.id, np.diag([10.0, 20.0, 30.0]), positive=True)
    node = session.annotations.points_node(state.id, positive=True)
    describe_points(node)
    before = table(node)
    session.annotations.remove_class(state.id)
    session.annotations.undo()
    assert table(session.annotations.points_node(state.id, positive=True)) == before


def test_what_is_undone_can_be_redone_whatever_else_is_said_of_points(session: SceneSession) -> None:
    state = session.annotations.add_class("liver")
    for x in (0.0, 10.0):
        session.annotations.add_points(state.id, np.array([[x, 0.0, 0.0]]), positive=True)
    session.annotations.undo()
    session.annotations.points_node(state.id, positive=True).SetNthControlPointLabel(0, "dome")
    assert session.annotations.can_redo
    session.annotations.redo()
    assert [row[0] for row in table(session.annotations.points_node(state.id, positive=True))] == ["dome", "2"]


def test_what_is_undone_below_a_transform_can_be_redone_after_the_mouse_has_moved_over_the_points(
    session: SceneSession,
) -> None:
    state = session.annotations.add_class("liver")
    node = session.annotations.points_node(state.id, positive=True)
    turn = np.eye(4)
    turn[:2, :2] = ((0.8, -0.6), (0.6, 0.8))
    turn[:3, 3] = (1.7, 0.3, 0.1)
    put_under(node, turn)
    session.annotations.add_points(state.id, np.random.default_rng(0).normal(size=(9, 3)), positive=True)
    session.annotations.erase_points(np.zeros((1, 3)), radius_mm=100.0)
    session.annotations.undo()
    node.GetDisplayNode().SetActiveControlPoint(1)
    assert session.annotations.can_redo


def recolour(node: Any) -> None:
    node.GetDisplayNode().SetSelectedColor(0.0, 1.0, 0.0)


def rename(node: Any) -> None:
    node.SetName("Leber")


def place(node: Any) -> None:
    node.AddControlPointWorld(vtk.vtkVector3d(30.0, 0.0, 0.0))


def drag(node: Any) -> None:
    # As Slicer's views do it.
    node.InvokeCustomModifiedEvent(node.PointStartInteractionEvent)
    for x in (1.0, 2.0, 3.0):
        node.SetNthControlPointPositionWorld(0, x, 0.0, 0.0)
    node.InvokeCustomModifiedEvent(node.PointEndInteractionEvent)


def delete(node: Any) -> None:
    node.RemoveNthControlPoint(0)


@pytest.mark.parametrize("change", [recolour, rename])
@pytest.mark.parametrize("step", [place, drag, delete])
def test_what_is_done_to_points_is_a_step_of_its_own_whatever_was_changed_in_slicer_before(
    session: SceneSession, change: Any, step: Any
) -> None:
    state = session.annotations.add_class("liver")
    session.annotations.add_points(state.id, np.zeros((2, 3)), positive=True)
    node = session.annotations.points_node(state.id, positive=True)
    change(node)
    before = session.classes
    step(node)
    after = session.classes
    assert after != before
    node.GetDisplayNode().SetSelectedColor(1.0, 0.0, 0.0)
    session.annotations.undo()
    assert session.classes == after
    session.annotations.undo()
    assert session.classes == before


def test_what_has_not_changed_is_kept_once_for_all_states_of_undo(session: SceneSession, spheres: Spheres) -> None:
    first, _ = (session.annotations.add_class(name) for name in "ab")
    session.annotations.add_points(first.id, centre_ras(spheres, 1), positive=True)
    before, other = session.classes
    session.annotations.add_points(first.id, centre_ras(spheres, 2), positive=True)
    after = session.classes[0]
    assert session.classes[1] is other
    assert after.positive[0] is before.positive[0]
    assert after.positive_properties[after.positive[0]] is before.positive_properties[before.positive[0]]
    session.annotations.undo()
    assert session.classes[0] == before
    assert session.classes[0].positive_properties == before.positive_properties


def test_a_list_that_is_deleted_in_slicer_takes_the_points_off_its_structure_along(
    session: SceneSession, slicer_app: Any, spheres: Spheres
) -> None:
    count = slicer_app.scene.GetNumberOfNodesByClass("vtkMRMLMarkupsFiducialNode")
    state = session.annotations.add_class("liver")
    session.annotations.add_points(state.id, centre_ras(spheres, 1), positive=False)
    before = session.classes
    slicer_app.scene.RemoveNode(session.annotations.points_node(state.id, positive=True))
    assert session.classes == ()
    assert slicer_app.scene.GetNumberOfNodesByClass("vtkMRMLMarkupsFiducialNode") == count
    session.annotations.undo()
    assert session.classes == before


@pytest.mark.slow
def test_maps_follow_lists_under_a_transform_and_undo_leads_to_no_place_from_before_they_were_moved(
    slicer_app: Any, spheres: Spheres
) -> None:
    session = open_spheres(slicer_app, spheres)
    first, *_ = annotate(session, spheres)
    session.select_class(first)
    before, ml = session.classes, session.volume_ml(first)
    lists = [session.annotations.points_node(state.id, positive) for state in before for positive in (True, False)]
    transform = put_under(lists[0], np.eye(4))
    for node in lists:
        node.SetAndObserveTransformNodeID(transform.GetID())
    assert session.annotations.can_undo
    assert not session.shown.is_on_selected(centre_ras(spheres, 2)[0])
    # From the middle of the first sphere to that of the second.
    shift = np.eye(4)
    shift[:3, 3] = (centre_ras(spheres, 2) - centre_ras(spheres, 1))[0]
    transform.SetMatrixTransformToParent(vtk_matrix(shift))
    session.wait()
    np.testing.assert_allclose(session.classes[0].positive, before[1].positive)
    assert session.shown.is_on_selected(centre_ras(spheres, 2)[0])
    assert not session.annotations.can_undo
    session.parameters.volume.SetAndObserveTransformNodeID(transform.GetID())
    session.wait()
    assert session.volume_ml(first) == pytest.approx(ml)
    session.annotations.add_points(first, centre_ras(spheres, 3), positive=False)
    session.annotations.undo()
    np.testing.assert_allclose(session.classes[0].positive, before[1].positive)
    session.close()


def test_after_a_transform_was_hardened_undo_leads_to_no_place_from_before(session: SceneSession, spheres: Spheres) -> None:
    state = session.annotations.add_class("liver")
    session.annotations.add_points(state.id, centre_ras(spheres, 1), positive=True)
    node = session.annotations.points_node(state.id, positive=True)
    put_under(node, np.diag([1.0, -1.0, 1.0, 1.0]))
    moved = session.classes
    node.HardenTransform()
    assert session.classes == moved
    session.annotations.add_points(state.id, centre_ras(spheres, 2), positive=True)
    while session.annotations.can_undo:
        session.annotations.undo()
    assert session.classes == moved


def test_a_copy_of_a_list_is_the_users_own(session: SceneSession, slicer_app: Any, spheres: Spheres) -> None:
    state = session.annotations.add_class("liver")
    session.annotations.add_points(state.id, centre_ras(spheres, 1), positive=False)
    copy = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    copy.Copy(session.annotations.points_node(state.id, positive=False))
    slicer_app.scene.RemoveNode(slicer_app.scene.AddNewNodeByClass("vtkMRMLModelNode"))
    slicer_app.scene.RemoveNode(session.annotations.points_node(state.id, positive=True))
    assert session.classes == ()
    assert slicer_app.scene.IsNodePresent(copy)
    assert copy.GetNumberOfControlPoints() == 1


def test_renaming_and_colouring_a_list_in_the_scene_is_renaming_and_colouring_the_class(
    session: SceneSession, spheres: Spheres
) -> None:
    (node, *_) = (annotate(session, spheres), class_nodes(session.parameters.node))[1]
    node.SetName("Leber, groß")
    node.GetDisplayNode().SetSelectedColor(0.0, 1.0, 0.5)
    assert (session.classes[0].name, session.classes[0].color) == ("Leber, groß", (0.0, 1.0, 0.5))
    outside = session.annotations.points_node(session.classes[0].id, positive=False)
    assert (outside.GetName(), outside.GetDisplayNode().GetSelectedColor()) == ("Leber, groß – outside", (0.0, 1.0, 0.5))


def test_points_that_are_hidden_in_slicer_stay_hidden_until_the_structure_is_shown_anew(
    session: SceneSession, spheres: Spheres
) -> None:
    annotations = session.annotations
    id_ = annotations.add_class("sphere").id
    points = annotations.points_node(id_, positive=True)
    points.SetDisplayVisibility(False)
    annotations.add_points(id_, centre_ras(spheres, 1), positive=True)
    annotations.set_class(id_, name="liver")
    annotations.undo()
    assert not points.GetDisplayVisibility()
    assert session.classes[0].visible
    annotations.set_class(id_, visible=False)
    annotations.set_class(id_, visible=True)
    assert points.GetDisplayVisibility()
