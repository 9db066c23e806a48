"""What stands in the user's way, by its cause: told once, and over when the cause is."""

from __future__ import annotations

from typing import Literal

Cause = Literal[
    "volume",
    "computing",
    "cache",
    "segments",
    "older segments",
    "views",
    "close-up",
    "left behind",
    "other scan",
    "model",
    "placing",
    "defect",
]
"""The volume or a setting; the compute process, or what it was asked for; features that cannot be kept; segments that could
not be written; those of a frame that users come back to; what cannot be shown; a structure that cannot be looked at more
closely; points that the volume was moved away from; points that were placed on another scan; the model that structures were
made with, which is not to be had; a point that was to be placed on nothing; what a poll raised."""


class Problems:
    """At most one problem of each cause."""

    def __init__(self) -> None:
        self._standing: dict[Cause, str] = {}
        self._untold: list[Cause] = []

    def put(self, cause: Cause, message: str) -> None:
        """There is a problem; `message` is for the user. One that stands already is not told again."""
        if self._standing.get(cause) != message:
            self.solve(cause)
            self._standing[cause] = message
            self._untold.append(cause)

    def solve(self, cause: Cause) -> None:
        """The cause is gone."""
        self._standing.pop(cause, None)
        if cause in self._untold:
            self._untold.remove(cause)

    def take(self) -> str | None:
        """The next problem that still stands and was not taken yet, in the order in which they came; None after the last."""
        return self._standing[self._untold.pop(0)] if self._untold else None

    def stands(self, cause: Cause) -> bool:
        """Whether there is a problem of this cause."""
        return cause in self._standing

    @property
    def standing(self) -> tuple[str, ...]:
        """All problems that there are now."""
        return tuple(self._standing.values())
