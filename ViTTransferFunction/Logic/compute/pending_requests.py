"""What a compute process was asked for, and has not answered yet."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from .client import ComputeClient
from .requests import UNFINISHED


class PendingRequests:
    """Asks one process at a time, once it is started; true while an answer is awaited. Nothing here waits.

    Args:
        start_client: starts a process.
    """

    def __init__(self, start_client: Callable[[], ComputeClient]) -> None:
        self._start_client = start_client
        self._client: ComputeClient | None = None
        self._by_number: dict[int, Any] = {}
        self._arrived: deque[tuple[int, Any]] = deque()

    def __bool__(self) -> bool:
        return bool(self._by_number)

    def start(self) -> None:
        """Start the process, if there is none. Raises InputError where that fails."""
        if self._client is None:
            self._client = self._start_client()

    @property
    def started(self) -> bool:
        """Whether there is a process, alive or not."""
        return self._client is not None

    @property
    def alive(self) -> bool:
        """Whether it runs, or there is still something that it said."""
        return self._client is not None and self._client.alive

    @property
    def pid(self) -> int | None:
        """The number of the process; None where there is none."""
        return self._client.pid if self._client else None

    def ask(self, request: Any) -> None:
        """Ask the started process for something (`requests`)."""
        assert self._client is not None
        self._by_number[self._client.request(request)] = request

    def has(self, *kinds: type) -> bool:
        """Whether an answer to a request of one of these kinds is awaited."""
        return any(isinstance(request, kinds) for request in self._by_number.values())

    def has_other_than(self, *kinds: type) -> bool:
        """Whether an answer to a request of any other kind is awaited."""
        return any(not isinstance(request, kinds) for request in self._by_number.values())

    def cancel(self, *kinds: type) -> None:
        """Have the process stop what it was asked for of these kinds; its answers are still awaited."""
        if self._client is not None and self.has(*kinds):
            self._client.cancel(self._numbers(kinds))

    def give_up(self, *kinds: type) -> None:
        """Let nothing of these kinds that was asked before delay, or be taken for, an answer to what comes."""
        self.cancel(*kinds)
        for number in self._numbers(kinds):
            del self._by_number[number]

    def replies(self) -> Iterator[tuple[Any, Any]]:
        """What has come since the last call, oldest first: a request that was not given up since, and a reply to it.

        Where whoever takes one in raises, the next call goes on with those behind it.
        """
        if self._client is not None:
            self._arrived.extend(self._client.replies())
        while self._arrived:
            number, reply = self._arrived.popleft()
            if number in self._by_number:
                unfinished = isinstance(reply, UNFINISHED)
                yield self._by_number[number] if unfinished else self._by_number.pop(number), reply

    def forget(self) -> None:
        """Await no answer any more; the process may go on with what it was asked for."""
        self._by_number.clear()

    def last_words(self) -> str:
        """Why the process died, in one line; "" where nobody knows."""
        return self._client.last_words() if self._client else ""

    def close(self) -> None:
        """End the process, and with it all requests."""
        if self._client is not None:
            self._client.close()
            self._client = None
        self._arrived.clear()
        self.forget()

    def _numbers(self, kinds: tuple[type, ...]) -> list[int]:
        return [number for number, request in self._by_number.items() if isinstance(request, kinds)]
