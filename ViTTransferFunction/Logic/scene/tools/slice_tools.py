"""A tool for the mouse, in all slice views at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Protocol


class SliceTool(Protocol):
    """Works in one slice view while active."""

    def activate(self) -> None:
        """Take the mouse."""

    def deactivate(self) -> None:
        """Give it back to the view."""


Draw = Callable[[], None]
"""Has a view drawn again soon."""

MakeTool = Callable[[Any, Any, Draw], SliceTool]
"""Makes a tool for one view of its interactor, its slice node, and what has it drawn again soon."""


class SliceTools:
    """Keeps a tool in every slice view, until it is stopped.

    Args:
        views: the slice views that there are now, each as `MakeTool` takes it.
    """

    def __init__(self, views: Callable[[], Iterable[tuple[Any, Any, Draw]]]) -> None:
        self._views = views
        self._make: MakeTool | None = None
        self._tools: list[SliceTool] = []

    def start(self, make: MakeTool) -> None:
        """Have a tool made for each view, and let them have the mouse."""
        self.stop()
        self._make = make
        self._tools = [make(*view) for view in self._views()]
        for tool in self._tools:
            tool.activate()

    def stop(self) -> None:
        """Give the mouse back to the views."""
        for tool in self._tools:
            tool.deactivate()
        self._tools = []
        self._make = None

    def follow_views(self) -> None:
        """There may be other views than before: those have the tool from now on, if there is one."""
        if self._make is not None:
            self.start(self._make)
