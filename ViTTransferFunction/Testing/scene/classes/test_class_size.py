"""A class's size as the user changes it: by steps, by the wheel, with undo, and for later clicks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.iso_proposals import LARGEST_SIZE, SMALLEST_SIZE
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.scene.classes.class_size import stepped, turned
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views import proposal_outlines
from ViTTransferFunction.Logic.scene.views.proposal_outlines import STYLE
from ViTTransferFunction.Testing.support.scenes import open_spheres, put_under
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


def a_class(**fields: Any) -> ClassState:
    return ClassState("a1", "liver", Appearance((0.0, 0.0, 0.0)), **fields)


@pytest.mark.parametrize(
    ("size", "smaller", "larger"),
    [
        (0.0, -1.0, 1.0),
        (1.0, 0.0, 1.5),
        (-1.0, -1.5, 0.0),
        (0.4, 0.0, 1.0),
        (-2.6, SMALLEST_SIZE, -2.5),
        (SMALLEST_SIZE, SMALLEST_SIZE, -2.5),
        (LARGEST_SIZE, 2.5, LARGEST_SIZE),
    ],
)
def test_steps_go_from_proposal_to_proposal_then_by_halves_and_end(size: float, smaller: float, larger: float) -> None:
    assert stepped(a_class(size=size), -1).size == smaller
    assert stepped(a_class(size=size), 1).size == larger


def test_notches_of_the_wheel_add_up_to_a_proposal_and_back_to_where_they_began() -> None:
    state = a_class()
    for _ in range(10):
        state = turned(state, 1)
    assert state.size == 1.0
    for _ in range(10):
        state = turned(state, -1)
    assert state.size == 0.0


def test_the_wheel_ends_where_sizes_do() -> None:
    assert turned(a_class(size=LARGEST_SIZE), 1).size == LARGEST_SIZE
    assert turned(a_class(size=SMALLEST_SIZE), -1).size == SMALLEST_SIZE


def test_a_fixed_iso_value_changes_itself_by_one_factor_for_keys_and_wheel() -> None:
    larger = stepped(a_class(iso=0.3), 1)
    assert larger.size == 0.0
    assert larger.iso == pytest.approx(0.15)
    assert stepped(larger, -1).iso == pytest.approx(0.3)
    state = a_class(iso=0.3)
    for _ in range(10):
        state = turned(state, 1)
    assert state.iso == pytest.approx(0.15)


@pytest.mark.parametrize("iso", [0.0, 0.005, 1.0])
def test_an_iso_value_at_its_end_stays_within_its_range(iso: float) -> None:
    for direction in (-1, 1):
        state = a_class(iso=iso)
        for _ in range(12):
            state = stepped(state, direction)
            assert state.iso is not None
            assert 0.0 <= state.iso <= 1.0


@pytest.fixture
def session(session_without_volume: SceneSession) -> SceneSession:
    return session_without_volume


def sizes(session: SceneSession) -> list[float]:
    return [state.size for state in session.classes]


def test_each_step_is_undone_by_itself_and_a_turn_of_the_wheel_as_a_whole(session: SceneSession) -> None:
    id_ = session.annotations.add_class().id
    session.annotations.step_size(id_, 1)
    session.annotations.step_size(id_, 1)
    for _ in range(3):
        session.annotations.turn_size(id_, -1)
    undone = []
    for _ in range(4):
        undone += sizes(session)
        session.annotations.undo()
    assert undone == [1.2, 1.5, 1.0, 0.0]


def test_a_duplicate_has_the_size_of_its_original_and_a_new_class_none(session: SceneSession) -> None:
    id_ = session.annotations.add_class().id
    session.annotations.step_size(id_, -1)
    session.annotations.duplicate_class(id_)
    session.annotations.add_class()
    assert sizes(session) == [-1.0, -1.0, 0.0]


def test_fixing_the_iso_value_ends_the_size_and_the_way_back_leads_to_what_is_chosen(session: SceneSession) -> None:
    id_ = session.annotations.add_class().id
    session.annotations.step_size(id_, 1)
    session.annotations.set_class(id_, iso=0.3)
    assert sizes(session) == [0.0]
    session.annotations.set_class(id_, iso=None)
    assert sizes(session) == [0.0]
    session.annotations.undo()
    assert sizes(session) == [1.0]


@pytest.fixture
def on_spheres(slicer_app: Any, spheres: Spheres) -> Iterator[tuple[SceneSession, str]]:
    """A session with one click on a sphere, refined; and the class."""
    session = open_spheres(slicer_app, spheres)
    id_ = session.annotations.add_class("sphere").id
    session.annotations.add_points(id_, centre_ras(spheres, 1), positive=True)
    session.wait()
    yield session, id_
    session.close()


def test_what_is_shown_follows_a_step_before_anything_is_computed_and_stays_when_it_was(
    on_spheres: tuple[SceneSession, str],
) -> None:
    session, id_ = on_spheres
    chosen, refined_ml = session.chosen_iso(id_), session.volume_ml(id_)
    session.annotations.step_size(id_, 1)
    larger = session.chosen_iso(id_)
    assert chosen is not None
    assert larger is not None
    assert larger < 0.5 * chosen
    while session.awaits_maps:
        session.poll()
    assert session.chosen_iso(id_) == pytest.approx(larger)
    session.wait()
    larger_ml = session.volume_ml(id_)
    assert refined_ml is not None
    assert larger_ml is not None
    assert larger_ml > refined_ml


def outlines_are_seen(session: SceneSession) -> bool:
    session.wait()
    model = session.parameters.node.GetScene().GetFirstNodeByName(STYLE.name)
    return bool(model and model.GetDisplayNode().GetVisibility() and model.GetPolyData().GetNumberOfPoints())


def test_other_sizes_are_outlined_while_there_are_any_and_the_user_wants_to_see_them(
    on_spheres: tuple[SceneSession, str],
) -> None:
    session, id_ = on_spheres
    # The spheres are so unlike everything else that their three proposals are one; only what is larger still is not.
    assert not outlines_are_seen(session)
    session.annotations.set_class(id_, size=2.0)
    assert outlines_are_seen(session)
    changes: tuple[dict[str, Any], ...] = ({"visible": False}, {"iso": 0.05})
    for change in changes:
        session.annotations.set_class(id_, **change)
        assert not outlines_are_seen(session)
        session.annotations.undo()
        assert outlines_are_seen(session)
    session.parameters.set("proposalsVisible", False)
    assert not outlines_are_seen(session)


def test_other_sizes_are_outlined_as_long_as_the_points_leave_open_what_is_meant(
    on_spheres: tuple[SceneSession, str], spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, id_ = on_spheres
    # All that is larger or smaller counts, so that there are others.
    monkeypatch.setattr(proposal_outlines, "LEAST_DIFFERENCE", 0.0)
    session.annotations.add_points(id_, centre_ras(spheres, 1) + 3.0, positive=True)
    assert outlines_are_seen(session)
    session.annotations.add_points(id_, centre_ras(spheres, 3), positive=False)
    assert not outlines_are_seen(session)
    session.annotations.set_class(id_, size=0.5)
    assert outlines_are_seen(session)
    session.annotations.undo()
    session.annotations.undo()
    assert outlines_are_seen(session)


def test_a_structure_is_pointed_at_where_its_volume_was_moved_to(
    on_spheres: tuple[SceneSession, str], spheres: Spheres
) -> None:
    session, id_ = on_spheres
    centre, elsewhere = centre_ras(spheres, 1)[0], centre_ras(spheres, 3)[0]
    assert session.shown.is_on_selected(centre)
    assert not session.shown.is_on_selected(elsewhere)
    matrix = np.eye(4)
    matrix[:3, 3] = (0.0, 100.0, 0.0)
    put_under(session.parameters.volume, matrix)
    session.annotations.undo()
    session.annotations.add_points(id_, centre[None] + matrix[:3, 3], positive=True)
    session.wait()
    assert session.shown.is_on_selected(centre + matrix[:3, 3])
    assert not session.shown.is_on_selected(centre)


@pytest.mark.slow
def test_later_clicks_leave_the_size_as_an_offset_and_undo_gives_back_what_was(
    on_spheres: tuple[SceneSession, str], spheres: Spheres
) -> None:
    session, id_ = on_spheres
    at_first = session.volume_ml(id_)
    session.annotations.step_size(id_, 1)
    session.annotations.add_points(id_, centre_ras(spheres, 2), positive=True)
    session.wait()
    with_offset = session.volume_ml(id_)
    session.annotations.set_class(id_, size=0.0)
    session.wait()
    without = session.volume_ml(id_)
    assert with_offset is not None
    assert without is not None
    assert with_offset > without
    for _ in range(3):
        session.annotations.undo()
    session.wait()
    assert session.volume_ml(id_) == at_first
