"""Undo and redo."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.scene.classes.history import LIMIT, AnnotationHistory


def test_undo_goes_back_step_by_step_and_redo_forward() -> None:
    history = AnnotationHistory("a")
    history.record("b")
    assert history.record("c")
    assert [history.undo(), history.undo(), history.redo(), history.redo()] == ["b", "a", "b", "c"]


def test_there_is_nothing_beyond_either_end() -> None:
    history = AnnotationHistory("a")
    assert not history.can_undo
    assert history.undo() == "a"
    assert not history.can_redo
    assert history.redo() == "a"
    history.record("b")
    history.undo()
    assert history.can_redo


def test_what_was_undone_is_forgotten_when_something_else_is_done() -> None:
    history = AnnotationHistory("a")
    history.record("b")
    history.undo()
    history.record("c")
    assert not history.can_redo
    assert history.undo() == "a"


def test_steps_of_one_kind_in_a_row_count_as_one() -> None:
    history = AnnotationHistory(0)
    for value in (1, 2, 3):
        history.record(value, kind="slider")
    assert history.undo() == 0


def test_a_row_of_steps_that_leads_back_is_none_and_what_follows_does_not_belong_to_the_step_before() -> None:
    history = AnnotationHistory(0)
    history.record(1)
    for value in (2, 1):
        history.record(value, kind="slider")
    assert history.undo() == 0
    history.redo()
    for value in (2, 1, 3, 4):
        history.record(value, kind="slider")
    assert [history.undo(), history.undo()] == [1, 0]


@given(st.lists(st.sampled_from(["undo", "redo", 0, 1, 2]), max_size=LIMIT))
def test_whatever_is_done_undo_leads_back_to_where_it_began(done: list[str | int]) -> None:
    history = AnnotationHistory(0)
    for each in done:
        if isinstance(each, int):
            history.record(each, kind="slider")
        else:
            getattr(history, each)()
    while history.can_undo:
        history.undo()
    assert history.undo() == 0


def test_a_seal_ends_a_row_of_steps() -> None:
    history = AnnotationHistory(0)
    history.record(1, kind="stroke")
    history.seal()
    history.record(2, kind="stroke")
    assert history.undo() == 1


def test_an_undo_is_never_merged_into_the_step_before() -> None:
    history = AnnotationHistory(0)
    history.record(1, kind="slider")
    history.undo()
    history.record(2, kind="slider")
    assert history.undo() == 0


def test_an_undo_ends_a_row_of_steps() -> None:
    history = AnnotationHistory(0)
    history.record(1)
    for value in (2, 3):
        history.record(value, kind="slider")
    assert history.undo() == 1
    history.record(4, kind="slider")
    assert history.undo() == 1


def test_what_comparisons_do_not_see_is_brought_back_as_it_was_last() -> None:
    history: AnnotationHistory[float] = AnnotationHistory(0.0)
    history.record(-0.0)
    history.record(1.0)
    assert str(history.undo()) == "-0.0"
    for value in (1.0, 0.0):
        history.record(value, kind="slider")
    assert str(history.redo()) == "0.0"


def test_an_equal_state_is_no_step() -> None:
    history = AnnotationHistory("a")
    assert not history.record("a")
    assert not history.can_undo


def test_the_oldest_states_are_dropped() -> None:
    history = AnnotationHistory(0)
    for value in range(1, LIMIT + 50):
        history.record(value)
    while history.can_undo:
        oldest = history.undo()
    assert oldest == 50
