"""Each thing that a page asks for is done once."""

from __future__ import annotations

import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.WebApp.page_requests import PageRequests


@pytest.fixture
def done() -> list[str]:
    return []


@pytest.fixture
def requests(done: list[str]) -> PageRequests:
    def click(where: str) -> int:
        done.append(where)
        return len(done)

    return PageRequests({"click": click}.get)


def test_what_is_asked_for_again_is_not_done_again(requests: PageRequests, done: list[str]) -> None:
    assert [requests("page", number, "click", [where]) for number, where in ((1, "a"), (2, "b"))] == [1, 2]
    assert [requests("page", number, "click", [where]) for number, where in ((1, "a"), (2, "b"), (3, "c"))] == [None, None, 3]
    assert done == ["a", "b", "c"]


def test_another_page_begins_anew_and_the_one_before_gets_nothing_more(requests: PageRequests, done: list[str]) -> None:
    requests("first", 1, "click", ["a"])
    requests("second", 1, "click", ["b"])
    requests("first", 2, "click", ["c"])
    assert done == ["a", "b"]
    assert (requests.is_of("first"), requests.is_of("second")) == (False, True)


def test_a_page_that_is_being_loaded_has_the_session_already(requests: PageRequests) -> None:
    requests("page", 1, "click", ["a"])
    requests.expect_page()
    assert not requests.is_of("page")
    assert not requests.is_of("")


def test_what_nothing_answers_counts(requests: PageRequests) -> None:
    assert requests("page", 1, "arrive") is None
    assert requests.is_of("page")
