"""Which views wait for an answer: where drawing is slow, the answer is seen sooner if they are not drawn before it comes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from ...compute.proxy import SegmentationProxy

Waiting = Literal["none", "3D", "all"]
"""Views that should not be drawn yet: all until the answer to a click is there, and 3D views until the rendering is."""


class AwaitedAnswer:
    """Tells the front end which views should wait.

    Args:
        proxy: knows which answers are under way.
        have_views_wait: called with the views that should wait now; each call replaces the one before.
    """

    def __init__(self, proxy: SegmentationProxy, have_views_wait: Callable[[Waiting], None]) -> None:
        self._proxy = proxy
        self._have_views_wait = have_views_wait
        self._shown_at_once = False

    def tell(self) -> None:
        """Tell the front end which views should wait at the moment."""
        self._have_views_wait(self._waiting)

    def show_before(self, show: Callable[[], bool]) -> None:
        """Show what can be shown before the answer to a new request is there.

        Args:
            show: shows it, and returns whether this changed what slice views show; if so, they do not wait for the answer.
        """
        self._shown_at_once = True  # Slice views must not wait before `show` has decided.
        self.tell()
        self._shown_at_once = show()
        self.tell()

    @property
    def _waiting(self) -> Waiting:
        if not self._proxy.awaits_views:
            return "none"
        return "3D" if self._proxy.first_up_to_date or self._shown_at_once else "all"
