"""Which threads a loop is shared out among."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence

import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.refinement.workers import SHARED_VOXELS, Workers
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.torch_threads import torch_threads

CPU = torch.device("cpu")


@pytest.fixture(autouse=True)
def three_threads() -> Iterator[None]:
    with torch_threads(3):
        yield


def done_by(voxels: int, torch_threads: set[int]) -> tuple[list[int], set[int]]:
    """The items that were worked on, in order, and the threads that did; `torch_threads` receives what PyTorch is set to."""
    items: list[int] = []
    threads: set[int] = set()
    all_begin = threading.Barrier(3 if voxels >= SHARED_VOXELS else 1)

    def work(some: Sequence[int]) -> None:
        if threading.get_ident() not in threads:
            all_begin.wait(LONGEST_WAIT_S)
        threads.add(threading.get_ident())
        torch_threads.add(torch.get_num_threads())
        items.extend(some)

    with Workers(CPU, voxels) as workers:
        workers.share_out(range(20), work)
    return sorted(items), threads


def test_much_work_is_shared_out_among_as_many_threads_as_pytorch_has() -> None:
    of_torch: set[int] = set()
    items, threads = done_by(SHARED_VOXELS, of_torch)
    assert items == list(range(20))
    assert len(threads) == 3
    assert threading.get_ident() not in threads
    assert of_torch == {1}


def test_little_work_is_done_by_the_caller_without_pytorchs_threads() -> None:
    of_torch: set[int] = set()
    items, threads = done_by(SHARED_VOXELS - 1, of_torch)
    assert items == list(range(20))
    assert threads == {threading.get_ident()}
    assert of_torch == {1}


@pytest.mark.parametrize("voxels", [1, SHARED_VOXELS])
def test_pytorch_keeps_its_number_of_threads(voxels: int) -> None:
    def fail(items: Sequence[int]) -> None:
        raise ValueError(items)

    with pytest.raises(ValueError, match="0"), Workers(CPU, voxels) as workers:
        workers.share_out(range(5), fail)
    assert torch.get_num_threads() == 3


@pytest.mark.parametrize("voxels", [1, SHARED_VOXELS])
def test_it_can_be_cancelled_before_and_within_a_loop(voxels: int) -> None:
    calls: list[int] = []

    def between() -> None:
        calls.append(1)
        if len(calls) == 3:
            raise Cancelled

    def count(workers: Workers) -> None:
        def work(items: Sequence[int]) -> None:
            for _ in items:
                workers.between()

        workers.share_out(range(5), work)

    with Workers(CPU, voxels, between) as workers, pytest.raises(Cancelled):
        count(workers)
    assert len(calls) >= 3
