"""What a front end tells the user, once each, until its cause is gone or the user closes it."""

from __future__ import annotations

from collections.abc import Callable


class Messages:
    """Those that stand, in the order in which they came."""

    def __init__(self) -> None:
        self._standing: dict[str, tuple[str, Callable[[], bool]]] = {}

    def put(self, message: str, solved: Callable[[], bool], about: str = "") -> None:
        """Add a message below those that stand already, until it is `solved`.

        Args:
            message: for the user.
            solved: whether its cause is gone.
            about: what the user tried; of one thing, only the last message stands. Empty: of nothing that is tried again.
        """
        self._standing.pop(about, None)
        # Two things may fail for one reason, which is told once.
        self._standing = {other: standing for other, standing in self._standing.items() if standing[0] != message}
        self._standing[about or message] = message, solved

    def try_again(self, about: str) -> None:
        """The user tries something once more, whose outcome counts."""
        self._standing.pop(about, None)

    def standing(self) -> tuple[str, ...]:
        """What is not solved yet."""
        self._standing = {about: (message, solved) for about, (message, solved) in self._standing.items() if not solved()}
        return tuple(message for message, _ in self._standing.values())

    def clear(self) -> None:
        """The user has read them."""
        self._standing = {}
