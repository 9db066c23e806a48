"""The answer that views wait for: where drawing takes its time, it is seen sooner if they are not drawn before it is there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from ...compute.proxy import SegmentationProxy

Waiting = Literal["none", "3D", "all"]
"""Views that had better not be drawn for the moment: all, until the answer to a click is there; 3D views, until theirs is."""


class AwaitedAnswer:
    """Says which views may wait.

    Args:
        proxy: knows which answers are under way.
        have_views_wait: called with the views that may wait, each time anew.
    """

    def __init__(self, proxy: SegmentationProxy, have_views_wait: Callable[[Waiting], None]) -> None:
        self._proxy = proxy
        self._have_views_wait = have_views_wait
        self._shown_at_once = False

    def tell(self) -> None:
        """Say it as it is now."""
        self._have_views_wait(self._waiting)

    def show_before(self, show: Callable[[], bool]) -> None:
        """Something was asked for: have shown what is known without the answer.

        Args:
            show: returns whether slice views have something else to show by that; then they do not wait for the answer.
        """
        self._shown_at_once = True  # Until it is known.
        self.tell()
        self._shown_at_once = show()
        self.tell()

    @property
    def _waiting(self) -> Waiting:
        if not self._proxy.awaits_views:
            return "none"
        return "3D" if self._proxy.first_up_to_date or self._shown_at_once else "all"
