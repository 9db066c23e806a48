"""Telling front ends that something which they show has changed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Notices:
    """Calls whoever wants to hear of changes."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []
        self._held: int | None = None

    def add_observer(self, callback: Callable[[], None]) -> None:
        """Call `callback` after each change."""
        self._listeners.append(callback)

    def tell(self) -> None:
        """There was a change."""
        if self._held is not None:
            self._held += 1
            return
        for listener in list(self._listeners):
            listener()

    @contextmanager
    def one(self) -> Iterator[None]:
        """Have front ends hear of changes when all are made: in between, there may be no class to work on."""
        self._held = 0
        try:
            yield
        finally:
            held, self._held = self._held, None
        if held:
            self.tell()

    def close(self) -> None:
        """Call nobody any more."""
        self._listeners.clear()
