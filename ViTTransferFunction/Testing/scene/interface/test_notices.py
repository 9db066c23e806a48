"""Telling front ends of changes."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Logic.scene.interface.notices import Notices


@pytest.fixture
def heard() -> list[str]:
    return []


@pytest.fixture
def notices(heard: list[str]) -> Notices:
    notices = Notices()
    notices.add_observer(lambda: heard.append("a change"))
    return notices


def test_changes_that_belong_together_are_told_once_when_all_are_made(notices: Notices, heard: list[str]) -> None:
    with notices.one():
        notices.tell()
        notices.tell()
        assert not heard
    assert heard == ["a change"]
    with notices.one():
        pass
    assert heard == ["a change"]


def test_after_a_change_that_failed_others_are_told_again(notices: Notices, heard: list[str]) -> None:
    def change_and_fail() -> None:
        with notices.one():
            notices.tell()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        change_and_fail()
    assert not heard
    notices.tell()
    assert heard == ["a change"]


def test_who_observes_may_add_another_observer(notices: Notices, heard: list[str]) -> None:
    notices.add_observer(lambda: notices.add_observer(lambda: heard.append("another")) if len(heard) == 1 else None)
    notices.tell()
    assert heard == ["a change"]
    notices.tell()
    assert heard[1:] == ["a change", "another"]
