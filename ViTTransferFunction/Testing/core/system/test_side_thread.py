"""A thread beside the caller's own."""

from __future__ import annotations

import gc
import threading
import weakref

import pytest

from ViTTransferFunction.Logic.core.system.side_thread import side_thread
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S


def test_work_is_done_in_another_thread_in_order() -> None:
    order: list[int] = []
    threads: set[int] = set()

    def work() -> None:
        order.append(len(order))
        threads.add(threading.get_ident())

    with side_thread() as begin:
        for _ in range(4):
            begin(work)
        begin(work)()
        assert order == [0, 1, 2, 3, 4]
    assert len(threads) == 1
    assert threading.get_ident() not in threads


def test_a_caller_that_gives_up_has_what_was_begun_finished_and_all_else_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, may_end, done = threading.Event(), threading.Event(), []
    join = threading.Thread.join

    def wait_for(thread: threading.Thread) -> None:
        may_end.set()
        join(thread)

    def first() -> None:
        begun.set()
        may_end.wait(LONGEST_WAIT_S)
        done.append("first")

    def give_up() -> None:
        with side_thread() as begin:
            begin(first)
            begin(lambda: done.append("second"))
            begun.wait(LONGEST_WAIT_S)
            raise KeyError

    monkeypatch.setattr(threading.Thread, "join", wait_for)
    with pytest.raises(KeyError):
        give_up()
    assert done == ["first"]


class Held:
    """What a caller holds."""


def test_an_error_is_raised_once_and_holds_nothing_when_it_was_dealt_with() -> None:
    def fail() -> None:
        raise KeyError

    def call() -> weakref.ref[Held]:
        held = Held()
        with side_thread() as begin:
            finish = begin(fail)
            with pytest.raises(KeyError):
                finish()
            finish()
        return weakref.ref(held)

    gc.disable()
    try:
        assert call()() is None
    finally:
        gc.enable()
