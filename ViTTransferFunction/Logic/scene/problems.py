"""What stands in the user's way, by its cause: told once, and over when the cause is."""

from __future__ import annotations

from typing import Literal

Cause = Literal["volume", "computing", "segments", "views"]
"""The volume or a setting; the compute process, or what it was asked for; segments that could not be written; what
cannot be shown."""


class Problems:
    """At most one problem of each cause."""

    def __init__(self) -> None:
        self._standing: dict[Cause, str] = {}
        self._untold: Cause | None = None

    def put(self, cause: Cause, message: str) -> None:
        """There is a problem; `message` is for the user. One that stands already is not told again."""
        if self._standing.get(cause) != message:
            self._standing[cause] = message
            self._untold = cause

    def solve(self, cause: Cause) -> None:
        """The cause is gone."""
        self._standing.pop(cause, None)

    def take(self) -> str | None:
        """The problem that came last, if it was not taken yet and still stands."""
        untold, self._untold = self._untold, None
        return self._standing.get(untold) if untold else None

    @property
    def standing(self) -> tuple[str, ...]:
        """All problems that there are now."""
        return tuple(self._standing.values())
