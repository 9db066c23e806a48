"""What the product's tools do to classes and points, and the steps that undo takes back."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import annotate
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


@pytest.fixture
def session(session_without_volume: SceneSession) -> SceneSession:
    return session_without_volume


def test_a_brush_stroke_is_one_step_and_so_is_one_of_the_eraser(session: SceneSession, spheres: Spheres) -> None:
    state = session.annotations.add_class("sphere")
    centre = centre_ras(spheres, 1)
    for step in range(4):
        session.annotations.add_points(state.id, centre + np.array([step, 0, 0]), positive=True, continued=step > 0)
    for step in range(4):
        session.annotations.add_points(state.id, centre + np.array([0, step, 0]), positive=False, continued=step > 0)
    session.annotations.erase_points(centre + np.array([0, 3, 0]), radius_mm=0.5)
    session.annotations.erase_points(centre + np.array([0, 2, 0]), radius_mm=0.5, continued=True)
    counts = []
    for _ in range(3):
        counts.append((len(session.classes[0].positive), len(session.classes[0].negative)))
        session.annotations.undo()
    counts.append((len(session.classes[0].positive), len(session.classes[0].negative)))
    assert counts == [(4, 2), (4, 4), (4, 0), (0, 0)]


def test_the_point_placed_last_is_removed_first_whatever_its_polarity(session: SceneSession, spheres: Spheres) -> None:
    state = session.annotations.add_class("sphere")
    session.annotations.add_points(state.id, centre_ras(spheres, 1), positive=True)
    session.annotations.add_points(state.id, centre_ras(spheres, 3), positive=False)
    session.annotations.remove_last_point(state.id)
    assert (len(session.classes[0].positive), len(session.classes[0].negative)) == (1, 0)
    session.annotations.remove_last_point(state.id)
    assert session.classes[0].positive == ()
    session.annotations.remove_last_point(state.id)
    assert (session.classes[0].positive, session.classes[0].negative) == ((), ())
    assert session.take_error() is None


def test_a_structure_is_begun_anew_with_its_name_and_look_in_one_step(session: SceneSession, spheres: Spheres) -> None:
    annotations = session.annotations
    other, state = annotations.add_class("liver"), annotations.add_class("spleen", (0.1, 0.2, 0.3))
    for id_ in (other.id, state.id):
        annotations.add_points(id_, centre_ras(spheres, 1), positive=True)
        annotations.add_points(id_, centre_ras(spheres, 3), positive=False)
    look = {"opacity": 0.5, "low": 10.0, "high": 20.0}
    annotations.set_class(state.id, size=1.0, proximity=0.5, close_up=(0.0, 0.0, 0.0, 40.0, 40.0, 40.0), **look)
    before = session.classes
    annotations.remove_points(state.id)
    assert session.classes == (before[0], ClassState(state.id, "spleen", before[1].look, proximity=0.5))
    annotations.undo()
    assert session.classes == before


def test_points_are_removed_in_the_reverse_of_the_order_in_which_they_were_placed(
    session: SceneSession, spheres: Spheres
) -> None:
    state = session.annotations.add_class("sphere")
    centre = centre_ras(spheres, 1)
    for step, positive in enumerate((False, True, True, False)):
        session.annotations.add_points(state.id, centre + np.array([step, 0, 0]), positive)
    counts = []
    for _ in range(2):
        session.annotations.remove_last_point(state.id)
        counts.append((len(session.classes[0].positive), len(session.classes[0].negative)))
    # What undo and redo bring back and take away leaves the order as it was.
    session.annotations.undo()
    session.annotations.redo()
    session.annotations.add_points(state.id, centre, positive=False)
    session.annotations.undo()
    for _ in range(2):
        session.annotations.remove_last_point(state.id)
        counts.append((len(session.classes[0].positive), len(session.classes[0].negative)))
    assert counts == [(2, 1), (1, 1), (0, 1), (0, 0)]


def test_a_removed_class_comes_back_with_its_points_and_settings(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.annotations.set_class(id_, iso=0.25, color=(0.1, 0.2, 0.3), refine=False)
    before = {state.id: state for state in session.classes}
    session.annotations.remove_class(id_)
    assert id_ not in {state.id for state in session.classes}
    session.annotations.undo()
    assert {state.id: state for state in session.classes} == before
    assert [state.id for state in session.classes] == list(before)


@pytest.mark.parametrize("how", ["removed", "undone"])
def test_the_lists_of_a_class_that_is_gone_leave_memory(session: SceneSession, how: str) -> None:
    state = session.annotations.add_class("sphere")
    lists = [weakref.ref(session.annotations.points_node(state.id, positive)) for positive in (True, False)]
    assert None not in [each() for each in lists]
    if how == "removed":
        session.annotations.remove_class(state.id)
    else:
        session.annotations.undo()
    gc.collect()
    assert [each() for each in lists] == [None, None]


def names(session: SceneSession) -> list[str]:
    return [state.name for state in session.classes]


def test_where_the_selected_class_goes_it_is_the_one_that_was_selected_before(session: SceneSession) -> None:
    ids = {name: session.annotations.add_class(name).id for name in ("liver", "spleen", "aorta", "lung")}
    for name in ("aorta", "spleen", "lung"):
        session.select_class(ids[name])

    def selected() -> str | None:
        return session.selected_class.name if session.selected_class else None

    after = []
    for name in ("lung", "spleen", "aorta", "liver"):
        session.annotations.remove_class(ids[name])
        after.append(selected())
    assert after == ["spleen", "aorta", "liver", None]
    for name in ("liver", "aorta", "spleen", "lung"):
        session.annotations.undo()
        assert selected() == name


def test_of_structures_to_which_slicer_gave_one_name_the_first_is_brought_along(session: SceneSession) -> None:
    first, second = (session.annotations.add_class(name) for name in ("liver", "spleen"))
    session.annotations.points_node(second.id, positive=True).SetName("liver")
    session.annotations.bring_along(session.classes)
    assert [(state.name, state.color) for state in session.classes[2:]] == [("liver", first.color)]


def test_a_duplicate_stands_below_its_original_with_its_settings_and_points(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.annotations.set_class(id_, iso=0.25, refine=False, style="glass")
    session.annotations.add_points(id_, centre_ras(spheres, 3), positive=False)
    duplicate = session.annotations.duplicate_class(id_)
    original, copy, *_ = session.classes
    assert names(session) == ["sphere 1", "sphere 1 copy", "sphere 2", "sphere 3"]
    assert replace(copy, id=original.id, name=original.name, look=original.look) == original
    assert replace(copy.look, color=original.color) == original.look
    assert copy.id == duplicate.id
    assert copy.color not in {state.color for state in session.classes if state.id != copy.id}
    session.annotations.duplicate_class(id_)
    assert names(session)[:3] == ["sphere 1", "sphere 1 copy (2)", "sphere 1 copy"]


def test_a_duplicate_goes_and_comes_back_by_one_step_of_undo_and_redo(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    before = session.classes
    duplicate = session.annotations.duplicate_class(id_)
    assert session.annotations.points_node(duplicate.id, positive=True).GetNthControlPointLabel(0) == "1"
    after = session.classes
    session.annotations.undo()
    assert session.classes == before
    session.annotations.redo()
    assert session.classes == after


def test_a_class_moves_up_and_down_as_far_as_the_ends_and_back_by_undo(session: SceneSession, spheres: Spheres) -> None:
    first, second, third = annotate(session, spheres)
    orders = []
    for id_, step in ((first, 1), (first, 1), (first, 1), (third, -1)):
        session.annotations.move_class(id_, step)
        orders.append([state.id for state in session.classes])
    assert orders == [[second, first, third], [second, third, first], [second, third, first], [third, second, first]]
    session.annotations.undo()
    session.annotations.undo()
    # A move that changed nothing was no step.
    assert [state.id for state in session.classes] == [second, first, third]


def test_front_ends_hear_of_no_fewer_structures_than_there_are_before_or_after_an_edit(
    session: SceneSession, spheres: Spheres
) -> None:
    first, *_ = annotate(session, spheres)
    heard: set[int] = set()
    session.add_observer(lambda: heard.add(len(session.classes)))
    session.annotations.move_class(first, 1)
    assert heard == {3}
    session.annotations.remove_class(first)
    assert heard == {3, 2}
    session.annotations.undo()
    assert heard == {3, 2}
    session.annotations.duplicate_class(first)
    assert heard == {4, 3, 2}


def test_a_class_keeps_its_name_where_the_new_one_is_empty(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    with pytest.raises(InputError, match="needs a name"):
        session.annotations.set_class(id_, name="  ")
    assert session.classes[0].name == "sphere 1"


@pytest.mark.parametrize("name", ["", "two\nlines"])
def test_a_list_that_was_given_an_odd_name_in_slicer_can_be_set_all_the_same(session: SceneSession, name: str) -> None:
    state = session.annotations.add_class("liver")
    session.annotations.points_node(state.id, positive=True).SetName(name)
    session.annotations.set_class(state.id, proximity=0.5)
    assert (session.classes[0].proximity, session.classes[0].name) == (0.5, name)


def test_no_structure_gets_the_name_of_another_one(session: SceneSession, spheres: Spheres) -> None:
    first, second, _ = annotate(session, spheres)
    before = session.classes
    with pytest.raises(InputError, match="There is a structure called 'sphere 1' already; this one keeps the name"):
        session.annotations.set_class(second, name=" sphere 1")
    assert session.classes == before
    session.annotations.set_class(first, name="sphere 1 ")
    assert session.classes == before
    # Nor does one look like another's: an ü, and a u with two dots over it.
    session.annotations.set_class(first, name="Dr\u00fcse")
    with pytest.raises(InputError, match="There is a structure called"):
        session.annotations.set_class(second, name="Dru\u0308se")
    session.annotations.set_class(first, name="sphere 1")
    for _ in range(2):
        session.annotations.add_class("sphere 1")
    assert [state.name for state in session.classes[3:]] == ["sphere 1 (2)", "sphere 1 (3)"]


@pytest.mark.parametrize("name", ["li\x14ver", "liver\ufffe", "liver\uffff"], ids=ascii)
def test_a_class_keeps_its_name_where_the_new_one_cannot_be_written(session: SceneSession, name: str) -> None:
    state = session.annotations.add_class("liver")
    with pytest.raises(InputError, match="cannot be written"):
        session.annotations.set_class(state.id, name=name)
    assert session.classes == (state,)


@pytest.mark.parametrize("positive", [True, False], ids=["inside", "outside"])
@pytest.mark.parametrize("tool", ["click", "brush"])
def test_a_hidden_structure_that_gets_a_point_is_shown_in_one_step(session: SceneSession, positive: bool, tool: str) -> None:
    annotations = session.annotations
    id_, other = annotations.add_class("liver").id, annotations.add_class("spleen").id
    annotations.set_class(id_, visible=False)
    annotations.set_class(other, visible=False)
    points = annotations.points_node(id_, positive)
    if tool == "click":
        points.AddControlPointWorld(vtk.vtkVector3d(1.0, 2.0, 3.0))
    else:
        annotations.add_points(id_, np.array([[1.0, 2.0, 3.0]]), positive)
    assert [state.visible for state in session.classes] == [True, False]
    assert points.GetDisplayNode().GetVisibility()
    annotations.undo()
    assert not session.classes[0].visible
    assert not points.GetDisplayNode().GetVisibility()
    assert points.GetNumberOfControlPoints() == 0


def test_a_list_that_is_made_again_is_hidden_with_its_structure(session: SceneSession, slicer_app: Any) -> None:
    id_ = session.annotations.add_class("sphere").id
    session.annotations.set_class(id_, visible=False)
    slicer_app.scene.RemoveNode(session.annotations.points_node(id_, positive=False))
    assert not session.annotations.points_node(id_, positive=False).GetDisplayVisibility()


@pytest.mark.parametrize("positive", [True, False])
def test_a_list_that_nothing_displays_is_displayed_again_in_its_colour_to_take_clicks(
    session: SceneSession, slicer_app: Any, positive: bool
) -> None:
    id_ = session.annotations.add_class("sphere", (0.1, 0.2, 0.3)).id
    slicer_app.scene.RemoveNode(session.annotations.points_node(id_, positive).GetDisplayNode())
    display = session.annotations.points_node(id_, positive).GetDisplayNode()
    assert display.GetSelectedColor() == pytest.approx((0.1, 0.2, 0.3))
    assert session.classes[0].color == pytest.approx((0.1, 0.2, 0.3))
