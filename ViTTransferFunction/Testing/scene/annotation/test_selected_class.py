"""Which class is selected, and which one is after something was done to the classes."""

from __future__ import annotations

import pytest

pytest.importorskip("slicer")

from ViTTransferFunction.Logic.scene.session import SceneSession


@pytest.fixture
def session(session_without_volume: SceneSession) -> SceneSession:
    """Of three classes, the second of which is selected."""
    for name in ("liver", "spleen", "aorta"):
        session_without_volume.annotations.add_class(name)
    session_without_volume.select_class(id_of(session_without_volume, "spleen"))
    return session_without_volume


def id_of(session: SceneSession, name: str) -> str:
    return next(state.id for state in session.classes if state.name == name)


def selected(session: SceneSession) -> str | None:
    return session.selected_class.name if session.selected_class else None


def test_neighbours_are_selected_and_the_last_one_is_followed_by_the_first(session: SceneSession) -> None:
    for step, name in ((1, "aorta"), (1, "liver"), (-1, "aorta"), (-1, "spleen")):
        session.selection.select_neighbour(step)
        assert selected(session) == name


def test_a_duplicate_is_selected_below_its_original(session: SceneSession) -> None:
    session.selection.duplicate(id_of(session, "liver"))
    assert [state.name for state in session.classes] == ["liver", "liver copy", "spleen", "aorta"]
    assert selected(session) == "liver copy"


def test_where_the_selected_class_is_removed_the_next_one_is_selected_or_else_the_last(session: SceneSession) -> None:
    for name in ("aorta", "liver", None):
        session.selection.remove(id_of(session, selected(session) or ""))
        assert selected(session) == name
    session.selection.select_neighbour(1)
    assert selected(session) is None


def test_where_another_class_is_removed_the_selected_one_stays(session: SceneSession) -> None:
    session.select_class(id_of(session, "aorta"))
    session.selection.remove(id_of(session, "liver"))
    assert selected(session) == "aorta"
