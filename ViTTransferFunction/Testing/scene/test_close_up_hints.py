"""When a closer look is suggested: after the second large correction of a structure, and until what ends it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import slicer

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import add_volume, open_spheres, put_under
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

SHIFT = np.array([[1.0, 0.0, 0.0, 100.0], [0.0, 1.0, 0.0, -50.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@pytest.fixture
def session(slicer_app: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> Iterator[SceneSession]:
    """A session whose first class has a click on the first sphere, which is shown. Boxes may be of any size."""
    monkeypatch.setattr("ViTTransferFunction.Logic.core.close_up_choice.LARGEST_SHARE", 1.0)
    session = open_spheres(slicer_app, spheres)
    session.annotations.add_class("sphere")
    correct(session, centre_ras(spheres, 1))
    yield session
    session.close()


def correct(session: SceneSession, points_ras: np.ndarray, positive: bool = True, continued: bool = False) -> None:
    """Add points (N, 3) to the first class in one step, and wait for the answer."""
    session.annotations.add_points(session.classes[0].id, points_ras, positive, continued)
    session.wait()
    assert session.take_error() is None


def correct_grossly(session: SceneSession, spheres: Spheres, count: int = 2) -> None:
    """Click on the other spheres, one after the other, of which nothing is shown yet."""
    for label in range(2, 2 + count):
        correct(session, centre_ras(spheres, label))


def suggested(session: SceneSession) -> bool:
    return session.suggests_closer_look(session.classes[0])


def test_a_closer_look_is_suggested_from_the_second_gross_correction_until_one_that_is_not(
    session: SceneSession, spheres: Spheres
) -> None:
    assert not suggested(session)
    correct_grossly(session, spheres, 1)
    assert not suggested(session)
    correct(session, centre_ras(spheres, 3))
    assert suggested(session)
    correct(session, centre_ras(spheres, 1) + 2.0)
    assert not suggested(session)
    # What was once passed over is not said again.
    correct(session, centre_ras(spheres, 1) + np.array([0.0, 0.0, 4.0]), positive=False)
    assert not suggested(session)


def test_points_off_the_structure_count_as_well(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres, 1)
    correct(session, centre_ras(spheres, 2) + np.array([2.0, 2.0, 2.0]), positive=False)
    assert suggested(session)


def test_small_corrections_suggest_nothing(session: SceneSession, spheres: Spheres) -> None:
    for distance in (12.0, 13.0, 14.0):
        correct(session, centre_ras(spheres, 1) + np.array([distance, 0.0, 0.0]))
    for distance in (18.0, 17.0):
        correct(session, centre_ras(spheres, 1) - np.array([distance, 0.0, 0.0]), positive=False)
    assert not suggested(session)


def test_it_goes_with_what_is_undone_and_comes_back_with_it(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    session.annotations.undo()
    assert not suggested(session)
    session.annotations.redo()
    session.wait()
    assert suggested(session)
    correct(session, centre_ras(spheres, 1) + 2.0)
    session.annotations.undo()
    session.wait()
    assert suggested(session)


def test_points_that_are_brought_back_are_not_judged_again(session: SceneSession, spheres: Spheres) -> None:
    correct(session, centre_ras(spheres, 1) + 2.0)
    correct_grossly(session, spheres, 1)
    for _ in range(3):
        session.annotations.undo()
        session.annotations.undo()
        session.wait()
        session.annotations.redo()
        session.annotations.redo()
        session.wait()
    assert not suggested(session)


def test_it_goes_with_points_that_are_removed(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    session.annotations.remove_last_point(session.classes[0].id)
    assert not suggested(session)
    session.wait()
    assert not suggested(session)


def test_who_has_looked_closer_is_not_told_again(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    session.look_closer(session.classes[0].id)
    assert session.classes[0].close_up is not None
    assert not suggested(session)
    session.annotations.undo()
    assert session.classes[0].close_up is None
    session.wait()
    assert not suggested(session)


def test_where_no_box_is_possible_there_is_nothing_to_suggest(
    session: SceneSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.close_up_choice.LARGEST_SHARE", 0.15)
    correct_grossly(session, spheres)
    assert not suggested(session)


def test_points_that_the_scene_comes_with_corrected_nothing(slicer_app: Any, session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    node = session.parameters.node
    session.close()
    again = SceneSession(slicer_app.scene, slicer_app.app_logic, node)
    again.wait()
    assert len(again.classes[0].positive) == 3
    assert not suggested(again)
    # One is not enough.
    correct(again, centre_ras(spheres, 2) + 1.0, positive=False)
    assert not suggested(again)
    again.close()


def test_what_is_placed_before_the_answer_corrected_nothing_that_was_shown(session: SceneSession, spheres: Spheres) -> None:
    id_ = session.classes[0].id
    for label in (2, 3):
        session.annotations.add_points(id_, centre_ras(spheres, label), positive=True)
    session.wait()
    assert not suggested(session)


def test_a_class_that_begins_with_points_was_not_corrected(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    copied = session.annotations.duplicate_class(session.classes[0].id)
    session.wait()
    assert not session.suggests_closer_look(next(state for state in session.classes if state.id == copied.id))
    assert suggested(session)


def test_a_stroke_is_one_correction(session: SceneSession, spheres: Spheres) -> None:
    correct(session, centre_ras(spheres, 2), continued=False)
    correct(session, centre_ras(spheres, 3), continued=True)
    assert not suggested(session)


def test_a_region_is_one_correction_and_gross_where_a_point_of_it_is(session: SceneSession, spheres: Spheres) -> None:
    near = centre_ras(spheres, 1) + 2.0
    correct(session, np.concatenate([near, centre_ras(spheres, 2), centre_ras(spheres, 2) + 1.0]))
    assert not suggested(session)
    correct(session, np.concatenate([near + 1.0, centre_ras(spheres, 3)]))
    assert suggested(session)


def test_a_moved_point_is_no_new_correction(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres, 1)
    correct(session, centre_ras(spheres, 1) + 2.0)
    move_last(session, centre_ras(spheres, 3))
    assert not suggested(session)


def test_a_gross_correction_that_is_moved_stays_one(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    move_last(session, centre_ras(spheres, 3) + 1.0)
    assert suggested(session)
    session.annotations.undo()
    session.wait()
    assert suggested(session)
    session.annotations.undo()
    session.wait()
    assert not suggested(session)


def move_last(session: SceneSession, to_ras: np.ndarray) -> None:
    """Drag the positive point that was placed last."""
    node = session.annotations.points_node(session.classes[0].id, positive=True)
    node.SetNthControlPointPositionWorld(node.GetNumberOfControlPoints() - 1, *to_ras[0])
    node.InvokeEvent(slicer.vtkMRMLMarkupsNode.PointEndInteractionEvent)
    session.wait()


def test_another_volume_begins_anew(slicer_app: Any, session: SceneSession, spheres: Spheres) -> None:
    first = session.parameters.volume
    correct_grossly(session, spheres)
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    session.wait()
    assert session.phase == "ready"
    assert not suggested(session)
    session.set_volume(first)
    session.wait()
    assert not suggested(session)
    session.annotations.undo()
    session.wait()
    session.annotations.redo()
    session.wait()
    assert not suggested(session)


def test_without_a_volume_nothing_is_suggested(session: SceneSession, spheres: Spheres) -> None:
    correct_grossly(session, spheres)
    session.set_volume(None)
    assert not suggested(session)


def test_what_is_not_shown_is_not_corrected(session: SceneSession, spheres: Spheres) -> None:
    session.annotations.set_class(session.classes[0].id, visible=False)
    session.wait()
    correct_grossly(session, spheres)
    assert not suggested(session)


def test_a_moved_volume_is_corrected_where_it_is(session: SceneSession, spheres: Spheres) -> None:
    session.annotations.remove_last_point(session.classes[0].id)
    put_under(session.parameters.volume, SHIFT)
    shift = SHIFT[:3, 3]
    for label in (1, 2):
        correct(session, centre_ras(spheres, label) + shift)
    correct(session, centre_ras(spheres, 1) + shift + 2.0)
    assert not suggested(session)
    session.annotations.undo()
    session.wait()
    correct(session, centre_ras(spheres, 3) + shift)
    assert suggested(session)


def test_corrections_of_one_class_are_not_those_of_another(session: SceneSession, spheres: Spheres) -> None:
    other = session.annotations.add_class("other").id
    session.annotations.add_points(other, centre_ras(spheres, 3), positive=True)
    session.wait()
    correct_grossly(session, spheres)
    assert suggested(session)
    assert not session.suggests_closer_look(session.classes[1])
