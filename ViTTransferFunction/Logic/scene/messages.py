"""What a front end tells the user, once each, until its cause is gone or the user closes it."""

from __future__ import annotations

from collections.abc import Callable


class Messages:
    """Those that stand, in the order in which they came."""

    def __init__(self) -> None:
        self._standing: dict[str, Callable[[], bool]] = {}

    def put(self, message: str, solved: Callable[[], bool]) -> None:
        """Add a message below those that stand already, until it is `solved`."""
        self._standing.pop(message, None)
        self._standing[message] = solved

    def standing(self) -> tuple[str, ...]:
        """What is not solved yet."""
        self._standing = {message: solved for message, solved in self._standing.items() if not solved()}
        return tuple(self._standing)

    def clear(self) -> None:
        """The user has read them."""
        self._standing = {}
