"""Threads that share out a loop, where PyTorch's own threads would share out each operation in it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

from ..core.system.progress import Between, nothing_between, one_at_a_time

if TYPE_CHECKING:
    import torch

Item = TypeVar("Item")

SHARES_PER_WORKER = 2
"""A worker that is held up leaves its second share to the others."""
SHARED_VOXELS = 2**23
"""Less work is done by the caller alone: its operations are so short that what threads lose by taking turns with Python's
lock is more than what they gain; with two, seven organs of 0.1 to 4 million voxels each took a fifth longer."""


class Workers:
    """As many threads as PyTorch is set to use, each running operations that are themselves not divided.

    A loop of many short operations is better divided this way. OpenMP's threads wait for each other after every operation, and
    wait by spinning: on a machine that has other work, each operation then takes a time slice of the scheduler, and a fifth of
    a second became ten. On a GPU there is nothing to divide, and where there is little to do, not enough (`SHARED_VOXELS`): the
    caller does the work.

    Use as a context: within it PyTorch is set to one thread.

    Args:
        device: where the operations run.
        voxels: how many the work is about.
        between: called before each loop, and wherever one calls `Workers.between`; may raise `Cancelled`.
    """

    def __init__(self, device: torch.device, voxels: int, between: Between = nothing_between) -> None:
        # What work that takes long calls between its steps, so that it can be cancelled; any of the threads may.
        self.between = one_at_a_time(between)
        self._on_cpu = device.type == "cpu"
        self._shared = voxels >= SHARED_VOXELS
        self._torch_threads = 1
        self._pool: ThreadPoolExecutor | None = None

    def __enter__(self) -> Workers:
        import torch

        self._torch_threads = torch.get_num_threads()
        if self._on_cpu and self._torch_threads > 1:
            # Threads that start from here on inherit it.
            torch.set_num_threads(1)
            self._pool = ThreadPoolExecutor(self._torch_threads) if self._shared else None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        import torch

        if self._pool is not None:
            self._pool.shutdown()
        if self._on_cpu:
            torch.set_num_threads(self._torch_threads)

    @property
    def shares(self) -> int:
        """How many parts a loop is divided into, where it is long enough."""
        return 1 if self._pool is None else SHARES_PER_WORKER * self._torch_threads

    def share_out(self, items: Sequence[Item], work: Callable[[Sequence[Item]], None]) -> None:
        """Call `work` with runs of consecutive items until all are done. It must not matter in which order."""
        self.between()
        shares = min(self.shares, len(items))
        if self._pool is None or shares <= 1:
            work(items)
            return
        ends = [len(items) * share // shares for share in range(shares + 1)]
        # Listed, so that an error is raised here.
        list(self._pool.map(work, [items[start:end] for start, end in itertools.pairwise(ends)]))
