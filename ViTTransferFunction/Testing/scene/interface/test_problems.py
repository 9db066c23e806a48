"""What stands in the user's way is told, each once."""

from __future__ import annotations

from ViTTransferFunction.Logic.scene.interface.problems import Problems


def test_problems_that_come_together_are_all_told_in_their_order() -> None:
    problems = Problems()
    problems.put("computing", "The process ended.")
    problems.put("views", "Nothing can be shown.")
    assert [problems.take() for _ in range(3)] == ["The process ended.", "Nothing can be shown.", None]
    assert problems.standing == ("The process ended.", "Nothing can be shown.")


def test_a_problem_that_stands_is_not_told_again() -> None:
    problems = Problems()
    for _ in range(2):
        problems.put("views", "Nothing can be shown.")
    assert [problems.take(), problems.take()] == ["Nothing can be shown.", None]
    problems.put("views", "Nothing can be shown.")
    assert problems.take() is None


def test_of_one_cause_only_the_last_problem_is_told() -> None:
    problems = Problems()
    for message in ("The first.", "The second."):
        problems.put("segments", message)
    assert [problems.take(), problems.take()] == ["The second.", None]


def test_what_was_solved_before_it_was_told_is_not_told() -> None:
    problems = Problems()
    problems.put("volume", "The volume is constant.")
    problems.put("views", "Nothing can be shown.")
    problems.solve("volume")
    assert [problems.take(), problems.take()] == ["Nothing can be shown.", None]
