"""Threads that each run whole pieces of work, where PyTorch's own threads would share out every operation in them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import torch

MOST_THREADS = 16
"""Each needs memory for what it works on, and all take turns at Python's lock."""

Item = TypeVar("Item")
Result = TypeVar("Result")


class UndividedThreads:
    """As many threads as PyTorch is set to use, up to `MOST_THREADS`, each running operations that are not divided.

    Work that consists of many short operations is better divided this way: OpenMP's threads wait for each other after every
    operation. While they sleep they have to be woken up each time; while they spin, on a machine that has other work, each
    operation takes a time slice of the scheduler.

    Use as a context: within it, the caller's operations are not divided either. Other threads' are, as before, and those of
    threads that start meanwhile.

    Args:
        device: where the operations run. On a GPU there is nothing to divide, and the caller does the work.
        shared: whether threads are wanted; otherwise, the caller does the work.

    Attributes:
        count: how many pieces of work run at once.
    """

    def __init__(self, device: torch.device, shared: bool = True) -> None:
        import torch

        self._on_cpu = device.type == "cpu"
        self._of_torch = torch.get_num_threads()
        self._pool: ThreadPoolExecutor | None = None
        self.count = min(self._of_torch, MOST_THREADS) if shared and self._on_cpu else 1

    def __enter__(self) -> UndividedThreads:
        import torch

        if self._on_cpu and self._of_torch > 1:
            try:
                if self.count > 1:
                    self._pool = ThreadPoolExecutor(self.count)
                    self._start_all(self._pool)
                torch.set_num_threads(1)
                self._let_others_divide()
            except BaseException:
                self._end()
                raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._end()

    def results(self, items: Iterable[Item], work: Callable[[Item], Result]) -> Iterator[Result]:
        """What `work` returns for each item, in the items' order; raises what it raises. All items are read at once."""
        return map(work, items) if self._pool is None else self._pool.map(work, items)

    def _start_all(self, pool: ThreadPoolExecutor) -> None:
        """Start every thread of the pool, and have it divide nothing."""
        import torch

        all_there = threading.Barrier(self.count)

        def begin(_: int) -> None:
            # Where PyTorch is first used in a thread, it takes the number that any thread has set last, whatever this one has.
            torch.get_num_threads()
            # So would any other thread, from here until the number is set to what others are to have: that is to be a moment,
            # and not as long as it takes to start threads.
            all_there.wait()
            torch.set_num_threads(1)

        try:
            list(pool.map(begin, range(self.count)))
        except BaseException:
            # The system may have no room for so many threads. Those that it has room for must not wait for the others.
            all_there.abort()
            raise

    def _end(self) -> None:
        import torch

        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        # Where it was 1, it may be so for this thread only.
        if self._on_cpu and self._of_torch > 1:
            torch.set_num_threads(self._of_torch)

    def _let_others_divide(self) -> None:
        """Threads in which PyTorch is not yet used get the number that any thread has set last, and keep it."""
        import torch

        last = threading.Thread(target=torch.set_num_threads, args=(self._of_torch,))
        last.start()
        last.join()
