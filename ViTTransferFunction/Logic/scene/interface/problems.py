"""Problems that the user is told of: once each, for as long as its cause lasts."""

from __future__ import annotations

from typing import Literal

Cause = Literal[
    "volume",  # The volume or a setting is refused.
    "computing",  # The compute process ended, or refused a request.
    "cache",  # Features cannot be kept on disk.
    "segments",  # Segments could not be written, or not be continued.
    "older segments",  # The user came back to a frame whose segments are older than the classes.
    "views",  # Something cannot be shown.
    "close-up",  # A structure cannot be looked at more closely.
    "left behind",  # The volume was moved away from its points.
    "other scan",  # The points were placed on another scan.
    "model",  # The model that the structures were made with is not available.
    "placing",  # A click in 3D hit nothing.
    "defect",  # A poll raised an unexpected error.
]


class Problems:
    """At most one problem of each cause."""

    def __init__(self) -> None:
        self._standing: dict[Cause, str] = {}
        self._untold: list[Cause] = []

    def put(self, cause: Cause, message: str) -> None:
        """There is a problem; `message` is for the user. If the same message stands already, it is not told again."""
        if self._standing.get(cause) != message:
            self.solve(cause)
            self._standing[cause] = message
            self._untold.append(cause)

    def solve(self, *causes: Cause) -> None:
        """These causes are gone, if they were there."""
        for cause in causes:
            self._standing.pop(cause, None)
            if cause in self._untold:
                self._untold.remove(cause)

    def take(self) -> str | None:
        """The oldest problem that still stands and has not been taken yet; None if there is none."""
        return self._standing[self._untold.pop(0)] if self._untold else None

    def stands(self, cause: Cause) -> bool:
        """Whether there is a problem of this cause."""
        return cause in self._standing

    @property
    def standing(self) -> tuple[str, ...]:
        """All problems that there are now."""
        return tuple(self._standing.values())
