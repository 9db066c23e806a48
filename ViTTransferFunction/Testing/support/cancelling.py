"""Users who cancel: as soon as there is progress, or some time later."""

from __future__ import annotations

import itertools
from collections.abc import Callable

from ViTTransferFunction.Logic.core.system.errors import Cancelled


def cancel_at_once(done: int, total: int, what: str) -> None:
    """Progress that cancels the work which reports it."""
    raise Cancelled


def cancel_at_call(count: int) -> Callable[[], None]:
    """What work calls between its steps, and what cancels it at the count-th call."""
    calls = itertools.count(1)

    def between() -> None:
        if next(calls) == count:
            raise Cancelled

    return between
