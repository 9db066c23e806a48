"""Looking closer at a structure, from the scene: its box goes into the class, and its segment follows."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.volumes.geometry import transform_points
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_close_up
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.scenes import annotate, put_under, segment_masks
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


def know_close_up(session: SceneSession, spheres: Spheres) -> None:
    """Put the features of the first class's close-up into the cache."""
    box = session.classes[0].close_up
    assert box is not None
    cache_known_close_up(*spheres, CloseUp(box[:3], box[3:]), np.array(session.classes[0].positive))


def test_a_structure_is_looked_at_closely_and_written_so(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    know_close_up(session, spheres)
    session.wait()
    session.segments.write()
    session.wait()
    assert session.take_error() is None
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    for name, mask in masks.items():
        assert dice(mask, spheres[1] == int(name[-1])) > 0.9


def test_looking_closer_and_at_the_whole_again_are_steps_of_undo(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    closer = session.classes[0].close_up
    session.close_ups.look_at_whole(id_)
    assert session.classes[0].close_up is None
    session.annotations.undo()
    assert session.classes[0].close_up == closer is not None
    session.annotations.undo()
    assert session.classes[0].close_up is None
    assert len(session.classes) == 3


def test_a_moved_volume_takes_the_box_of_a_later_look_along(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    before = session.classes[0].close_up
    assert before is not None
    session.close_ups.look_at_whole(id_)
    put_under(session.parameters.volume, np.array([[1, 0, 0, 100.0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    session.annotations.add_points(id_, centre_ras(spheres, 1) + np.array([100.0, 0.0, 0.0]), positive=True)
    session.wait()
    session.close_ups.look_closer(id_)
    after = session.classes[0].close_up
    assert after is not None
    assert after[0] == pytest.approx(before[0] + 100.0, abs=5.0)


TURN = np.array([[0.8, -0.6, 0.0, 100.0], [0.6, 0.8, 0.0, -20.0], [0.0, 0.0, 1.0, 30.0], [0.0, 0.0, 0.0, 1.0]])


@pytest.fixture
def under_transform(session: SceneSession, spheres: Spheres) -> tuple[tuple[float, ...], Any]:
    """The box in which the first class is looked at, and a transform to move volume and points by."""
    (id_, *_) = annotate(session, spheres)
    transform = put_under(session.parameters.volume, np.eye(4))
    for node in lists_of(session):
        node.SetAndObserveTransformNodeID(transform.GetID())
    session.close_ups.look_closer(id_)
    know_close_up(session, spheres)
    session.wait()
    box = session.classes[0].close_up
    assert box is not None
    return box, transform


def lists_of(session: SceneSession) -> list[Any]:
    return [session.annotations.points_node(state.id, positive) for state in session.classes for positive in (True, False)]


def test_a_box_goes_along_with_its_points_and_stays_where_these_stay(
    session: SceneSession, under_transform: tuple[tuple[float, ...], Any]
) -> None:
    box, transform = under_transform
    for share in (0.5, 1.0):
        matrix = TURN.copy()
        matrix[:3, 3] *= share
        transform.SetMatrixTransformToParent(vtk_matrix(matrix))
    session.wait()
    moved = session.classes[0].close_up
    assert moved == pytest.approx((*transform_points(TURN, np.array(box[:3]))[0], *box[3:]))
    # Of features that are not in the cache, an error would tell.
    assert session.take_error() is None
    assert not session.annotations.can_undo
    for node in [session.parameters.volume, *lists_of(session)]:
        node.HardenTransform()
    session.wait()
    assert session.classes[0].close_up == moved


def test_a_box_of_another_scene_is_where_that_has_it(
    slicer_app: Any, session: SceneSession, under_transform: tuple[tuple[float, ...], Any]
) -> None:
    box, transform = under_transform
    slicer_app.scene.StartState(slicer_app.scene.RestoreState)
    transform.SetMatrixTransformToParent(vtk_matrix(TURN))
    slicer_app.scene.EndState(slicer_app.scene.RestoreState)
    session.wait()
    assert session.classes[0].close_up == box


def test_one_structure_after_the_other_may_be_looked_at_without_waiting(session: SceneSession, spheres: Spheres) -> None:
    ids = annotate(session, spheres)
    for id_ in ids:
        session.close_ups.look_closer(id_)
    assert all(state.close_up is not None for state in session.classes)
    assert session.take_error() is None


def test_a_closer_look_that_is_cancelled_is_taken_back(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    cancel_looking(session)
    assert session.classes[0].close_up is None
    session.wait()
    assert session.progress is None
    assert session.take_error() is None
    assert session.volume_ml(id_) is not None


def test_a_closer_look_goes_on_and_what_is_shown_stays_while_structures_are_put_into_another_order(
    session: SceneSession, spheres: Spheres
) -> None:
    ids = annotate(session, spheres)
    session.close_ups.look_closer(ids[0])
    wait_until_under_way(session)
    lacking: set[str] = set()
    session.add_observer(lambda: lacking.update(id_ for id_ in ids if session.chosen_iso(id_) is None))
    session.annotations.move_class(ids[0], 1)
    assert session.looks_closer
    assert not lacking


def test_the_box_in_use_is_as_large_as_points_beyond_make_it(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    assert session.close_ups.size_mm(session.classes[0]) is None
    session.close_ups.look_closer(id_)
    set_one = session.classes[0].close_up
    assert set_one is not None
    assert session.close_ups.size_mm(session.classes[0]) == pytest.approx(set_one[3:])
    beyond = centre_ras(spheres, 2)
    session.annotations.add_points(id_, beyond, positive=True)
    geometry, points = spheres[0].geometry, np.concatenate([centre_ras(spheres, 1), beyond])
    used = CloseUp(set_one[:3], set_one[3:]).box_in(geometry, points)
    in_use = session.close_ups.size_mm(session.classes[0])
    assert in_use == pytest.approx(geometry.part(used).extent_mm)
    assert in_use is not None
    assert max(np.subtract(in_use, set_one[3:])) > 10.0
    # What was set is what is saved, and what a point that is taken back leads to again.
    assert session.classes[0].close_up == set_one
    session.annotations.undo()
    assert session.close_ups.size_mm(session.classes[0]) == pytest.approx(set_one[3:])


def test_without_a_volume_a_box_is_as_large_as_it_was_set(slicer_app: Any, session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.annotations.set_close_up(id_, (1.0, 2.0, 3.0, 40.5, 50.0, 60.0))
    slicer_app.scene.RemoveNode(session.parameters.volume)
    assert session.close_ups.size_mm(session.classes[0]) == (40.5, 50.0, 60.0)


def test_where_another_closer_look_is_cancelled_the_one_before_stays(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    know_close_up(session, spheres)
    session.wait()
    before = session.classes[0].close_up
    assert before is not None
    session.annotations.set_close_up(id_, (*before[:3], 50.0, 50.0, 50.0))
    cancel_looking(session)
    assert session.classes[0].close_up == before
    session.wait()
    assert session.take_error() is None


def test_where_the_volume_is_moved_before_another_closer_look_is_cancelled_the_one_before_is_where_it_is_now(
    session: SceneSession, under_transform: tuple[tuple[float, ...], Any]
) -> None:
    box, transform = under_transform
    x, y, z, *_ = box
    session.annotations.set_close_up(session.classes[0].id, (x, y, z, 50.0, 50.0, 50.0))
    wait_until_under_way(session)
    transform.SetMatrixTransformToParent(vtk_matrix(TURN))
    session.poll()
    cancel_looking(session)
    assert session.classes[0].close_up == pytest.approx((*transform_points(TURN, np.array(box[:3]))[0], *box[3:]))


def test_where_a_point_enlarged_the_box_cancelling_leads_back_to_the_whole(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    know_close_up(session, spheres)
    session.wait()
    session.annotations.add_points(id_, centre_ras(spheres, 2), positive=True)
    cancel_looking(session)
    assert session.classes[0].close_up is None
    session.wait()
    assert session.take_error() is None


def cancel_looking(session: SceneSession) -> None:
    """Cancel a closer look as soon as it is under way."""
    wait_until_under_way(session)
    session.cancel()


def wait_until_under_way(session: SceneSession) -> None:
    """Wait until a closer look is."""
    until = time.monotonic() + LONGEST_WAIT_S
    while not session.looks_closer and time.monotonic() < until:
        session.poll()
    assert session.progress is not None


def test_a_closer_look_is_suggested_for_what_is_vague_until_there_is_one(
    session: SceneSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 1.0)
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.vague_extent.MUCH_LARGER", 1.0)
    (id_, *_) = annotate(session, spheres)
    assert session.close_up_hints.of(session.classes[0]) == "vague extent"
    session.close_ups.look_closer(id_)
    assert session.close_up_hints.of(session.classes[0]) is None
    session.close_ups.look_at_whole(id_)
    session.wait()
    assert session.close_up_hints.of(session.classes[0]) is None
    assert session.take_error() is None


def test_a_closer_look_is_suggested_after_a_diameter_that_is_short_for_the_cells_of_the_volume(
    session: SceneSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 1.0)
    four_cells_mm = 4.0 * spheres[0].geometry.extent_mm.max() / GRID
    said = {}
    for share in (0.9, 1.1):
        id_ = session.annotations.add_class(f"diameter of {share}").id
        half = np.array([0.0, 0.5 * share * four_cells_mm, 0.0])
        session.regions.add_diameter(id_, centre_ras(spheres, 1) + np.stack([-half, half]))
        session.wait()
        said[share] = session.close_up_hints.of(session.classes[-1])
    assert said == {0.9: "small drawing", 1.1: None}


@pytest.fixture
def unasked(session: SceneSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> SceneSession:
    """A session in which a close-up has just begun unasked: all of a sphere was shown where half of it was outlined."""
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 1.0)
    id_ = session.annotations.add_class("half a sphere").id
    session.regions.add_outline(id_, outline_in_sphere(spheres, 0.5))
    until = time.monotonic() + LONGEST_WAIT_S
    while session.classes[0].close_up is None and time.monotonic() < until:
        session.poll()
    return session


def outline_in_sphere(spheres: Spheres, share: float) -> np.ndarray:
    """A circle around the middle of the first sphere, so much as wide as the sphere; (60, 3) RAS millimetres, in a slice."""
    geometry, labels = spheres[0].geometry, spheres[1]
    radius_mm = (0.75 / np.pi * np.count_nonzero(labels == 1) * geometry.voxel_volume_mm3) ** (1.0 / 3.0)
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    ijk = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1) * share * radius_mm / geometry.spacing_mm
    middle = geometry.ras_to_ijk(centre_ras(spheres, 1))
    return geometry.ijk_to_ras_points(middle + ijk)


def test_a_small_outline_of_what_is_shown_as_something_else_is_looked_at_closely_unasked(
    unasked: SceneSession, spheres: Spheres
) -> None:
    know_close_up(unasked, spheres)
    assert unasked.close_up_hints.of(unasked.classes[0]) == "small outline"
    unasked.wait()
    assert unasked.close_ups.size_mm(unasked.classes[0]) is not None
    assert unasked.volume_ml(unasked.classes[0].id) is not None
    assert unasked.take_error() is None


def test_undo_takes_the_close_up_back_then_the_outline_and_neither_begins_again(
    unasked: SceneSession, spheres: Spheres
) -> None:
    know_close_up(unasked, spheres)
    unasked.wait()
    box, points = unasked.classes[0].close_up, unasked.classes[0].positive
    steps = [unasked.annotations.undo, unasked.annotations.undo, unasked.annotations.redo, unasked.annotations.redo]
    found = []
    for step in steps:
        step()
        unasked.wait()
        found.append((unasked.classes[0].close_up, unasked.classes[0].positive))
    assert found == [(None, points), (None, ()), (None, points), (box, points)]
    assert unasked.take_error() is None


@pytest.mark.parametrize("cancelled", [True, False])
def test_a_close_up_that_began_unasked_is_cancelled_or_left_and_does_not_begin_again(
    unasked: SceneSession, spheres: Spheres, cancelled: bool
) -> None:
    if cancelled:
        cancel_looking(unasked)
    else:
        unasked.close_ups.look_at_whole(unasked.classes[0].id)
    unasked.wait()
    unasked.annotations.add_points(unasked.classes[0].id, centre_ras(spheres, 1) + 1.0, positive=True)
    unasked.wait()
    assert (unasked.classes[0].close_up, unasked.close_up_hints.of(unasked.classes[0])) == (None, None)
    assert unasked.take_error() is None


def test_a_small_outline_of_what_is_shown_so_stays_in_the_whole(
    session: SceneSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 1.0)
    id_ = session.annotations.add_class("sphere").id
    session.regions.add_outline(id_, outline_in_sphere(spheres, 1.0))
    session.wait()
    assert (session.classes[0].close_up, session.close_up_hints.of(session.classes[0])) == (None, None)


def test_a_box_that_could_not_be_looked_at_is_told_and_tried_again(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    session.close_ups.look_closer(id_)
    box = session.classes[0].close_up
    session.wait()
    assert "weights" in (session.take_error() or "")
    assert session.close_ups.failed(session.classes[0])
    session.annotations.add_points(id_, centre_ras(spheres, 2), positive=False)
    session.wait()
    assert (session.errors, session.close_ups.failed(session.classes[0])) == ((), True)
    # What was in the way is gone.
    session.annotations.undo()
    know_close_up(session, spheres)
    session.close_ups.look_closer(id_)
    session.wait()
    assert session.take_error() is None
    assert (session.classes[0].close_up, session.close_ups.failed(session.classes[0])) == (box, False)


def test_before_there_is_a_map_the_user_is_told_what_to_do(session: SceneSession) -> None:
    state = session.annotations.add_class("adrenal gland")
    session.close_ups.look_closer(state.id)
    assert session.classes[0].close_up is None
    assert "Place a point on adrenal gland first" in (session.take_error() or "")


def test_a_structure_that_fills_the_scan_is_refused_by_name(
    session: SceneSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    (id_, *_) = annotate(session, spheres)
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 0.01)
    session.close_ups.look_closer(id_)
    assert session.classes[0].close_up is None
    error = session.take_error() or ""
    assert "sphere 1: This structure's box fills" in error
    session.annotations.add_points(id_, centre_ras(spheres, 1) + 1.0, positive=True)
    assert session.errors == ()


def test_a_garbled_box_in_a_saved_scene_is_none(session: SceneSession, spheres: Spheres) -> None:
    (id_, *_) = annotate(session, spheres)
    node = session.annotations.points_node(id_, positive=True)
    for text in ("1 2 3", "a b c d e f", "0 0 0 -1 1 1", "0 0 0 nan 1 1"):
        node.SetAttribute("ViTTransferFunction.closeUp", text)
        session.annotations.refresh()
        assert session.classes[0].close_up is None
    node.SetAttribute("ViTTransferFunction.closeUp", "1 2 3 40.5 50 60")
    session.annotations.refresh()
    assert session.classes[0].close_up == (1.0, 2.0, 3.0, 40.5, 50.0, 60.0)
