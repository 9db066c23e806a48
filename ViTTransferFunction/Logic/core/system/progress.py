"""Progress and cancellation: one callback, passed down to everything that takes longer than a moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Protocol


class Progress(Protocol):
    """Called with the work done so far; raises `Cancelled` to stop the work at that point."""

    def __call__(self, done: int, total: int, what: str) -> None:
        """Report `done` of `total` steps of the work named `what` (such as "Computing features")."""


Between = Callable[[], None]
"""A `Progress` that is told nothing: called between short steps of work; raises `Cancelled` to stop the work at that point."""

SEGMENTING = "Segmenting structures"
"""What is being done while structures are segmented, for users."""


@dataclass(frozen=True)
class WorkProgress:
    """How far running work is: `done` of `total` steps of `what`; `seconds_left` is None until it can be told."""

    done: int
    total: int
    what: str
    seconds_left: float | None


def no_progress(done: int, total: int, what: str) -> None:
    """The callback of those who do not watch."""


def nothing_between() -> None:
    """The callback of those who do not interrupt."""


def one_at_a_time(between: Between) -> Between:
    """The same for several threads: it is called by one of them after the other."""
    calling = Lock()

    def in_turn() -> None:
        with calling:
            between()

    return in_turn
