"""Threads whose operations are not divided."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest
import torch

from ViTTransferFunction.Logic.core.system.undivided_threads import MOST_THREADS, UndividedThreads
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.torch_threads import torch_threads

CPU = torch.device("cpu")


@pytest.fixture(autouse=True)
def three_threads() -> Iterator[None]:
    with torch_threads(3):
        yield


def in_new_thread(work: Callable[[], int]) -> int:
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(work()))
    thread.start()
    thread.join(LONGEST_WAIT_S)
    return found[0]


def test_results_come_in_order_from_threads_that_do_not_divide_their_operations() -> None:
    all_at_once = threading.Barrier(3)

    def work(item: int) -> tuple[int, int, int]:
        all_at_once.wait(LONGEST_WAIT_S)
        return item, threading.get_ident(), torch.get_num_threads()

    with UndividedThreads(CPU) as threads:
        found = list(threads.results(range(9), work))
    assert [item for item, _, _ in found] == list(range(9))
    assert {of_torch for _, _, of_torch in found} == {1}
    assert len({thread for _, thread, _ in found} - {threading.get_ident()}) == threads.count == 3


def test_a_computer_of_many_processors_does_not_need_memory_for_each() -> None:
    with torch_threads(64), UndividedThreads(CPU) as threads:
        assert threads.count == MOST_THREADS
        assert len(set(threads.results(range(100), lambda _: threading.get_ident()))) <= MOST_THREADS
    assert torch.get_num_threads() == 3


@pytest.mark.parametrize(("device", "shared", "of_torch"), [(CPU, False, 1), (torch.device("meta"), True, 3)])
def test_the_caller_works_where_threads_are_not_wanted_or_of_no_use(device: torch.device, shared: bool, of_torch: int) -> None:
    with UndividedThreads(device, shared) as threads:
        found = list(threads.results(range(3), lambda item: (item, threading.get_ident(), torch.get_num_threads())))
    assert found == [(item, threading.get_ident(), of_torch) for item in range(3)]
    assert threads.count == 1


@pytest.mark.parametrize("shared", [True, False])
def test_other_threads_go_on_dividing_their_operations(shared: bool) -> None:
    with UndividedThreads(CPU, shared):
        assert torch.get_num_threads() == 1
        # A thread in which PyTorch was not used before, such as the one that answers the first click.
        assert in_new_thread(torch.get_num_threads) == 3
    assert torch.get_num_threads() == 3
    assert in_new_thread(torch.get_num_threads) == 3


def test_after_an_error_what_was_not_begun_is_dropped_and_pytorch_has_its_threads() -> None:
    begun: list[int] = []
    failed = threading.Event()

    def work(item: int) -> None:
        begun.append(item)
        if item == 0:
            raise ValueError(item)
        failed.wait(LONGEST_WAIT_S)

    def run_all(threads: UndividedThreads) -> None:
        try:
            list(threads.results(range(100), work))
        finally:
            failed.set()

    with pytest.raises(ValueError, match="0"), UndividedThreads(CPU) as threads:
        run_all(threads)
    assert len(begun) < 100
    assert torch.get_num_threads() == 3


@pytest.mark.parametrize("startable", range(4))
def test_where_the_system_has_no_room_for_a_thread_nothing_is_left_behind(
    startable: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, started, start = set(threading.enumerate()), list[threading.Thread](), threading.Thread.start

    def start_some(thread: threading.Thread) -> None:
        if len(started) == startable:
            raise RuntimeError("can't start new thread")
        started.append(thread)
        start(thread)

    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", start_some)
        with pytest.raises(RuntimeError, match="can't start new thread"), UndividedThreads(CPU):
            pass
    assert set(threading.enumerate()) == before
    assert torch.get_num_threads() == 3
    assert in_new_thread(torch.get_num_threads) == 3


def test_threads_within_threads_leave_the_others_as_they_are() -> None:
    with UndividedThreads(CPU):
        with UndividedThreads(CPU) as inner:
            assert inner.count == 1
        assert torch.get_num_threads() == 1
        assert in_new_thread(torch.get_num_threads) == 3
