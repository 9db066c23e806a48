"""Loops over parts of a volume, shared out among threads."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

from ..core.system.progress import Between, nothing_between, one_at_a_time
from ..core.system.undivided_threads import UndividedThreads

if TYPE_CHECKING:
    import torch

Item = TypeVar("Item")

SHARES_PER_WORKER = 2
"""A worker that is held up leaves its second share to the others."""
SHARED_VOXELS = 2**23
"""Less work is done by the caller alone: its operations are so short that what threads lose by taking turns with Python's
lock is more than what they gain; with two, seven organs of 0.1 to 4 million voxels each took a fifth longer."""


class Workers:
    """Shares out loops among threads whose operations are not divided (`UndividedThreads`), unless there is little to do.

    On a machine that had other work, a fifth of a second became ten where PyTorch's own threads shared out every operation.

    Use as a context: within it PyTorch is set to one thread.

    Args:
        device: where the operations run.
        voxels: how many the work is about; with less than `SHARED_VOXELS`, the caller does it.
        between: called before each loop, and wherever one calls `Workers.between`; may raise `Cancelled`.
    """

    def __init__(self, device: torch.device, voxels: int, between: Between = nothing_between) -> None:
        # What work that takes long calls between its steps, so that it can be cancelled; any of the threads may.
        self.between = one_at_a_time(between)
        self._threads = UndividedThreads(device, shared=voxels >= SHARED_VOXELS)

    def __enter__(self) -> Workers:
        self._threads.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._threads.__exit__(kind, error, trace)

    @property
    def shares(self) -> int:
        """How many parts a loop is divided into, where it is long enough."""
        return 1 if self._threads.count == 1 else SHARES_PER_WORKER * self._threads.count

    def share_out(self, items: Sequence[Item], work: Callable[[Sequence[Item]], None]) -> None:
        """Call `work` with runs of consecutive items until all are done. It must not matter in which order."""
        self.between()
        shares = min(self.shares, len(items))
        if shares <= 1:
            work(items)
            return
        ends = [len(items) * share // shares for share in range(shares + 1)]
        # Listed, so that an error is raised here.
        list(self._threads.results([items[start:end] for start, end in itertools.pairwise(ends)], work))
