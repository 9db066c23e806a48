"""What a page asks for is done once, and in its order, also where its connection broke and it had to ask again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


class PageRequests:
    """Takes the requests of the page that was opened last.

    A page numbers its requests from 1, and sends those that were not answered again over its next connection: it cannot tell
    whether they arrived.

    Args:
        find: what answers a request, by its name; None if nothing does.
    """

    def __init__(self, find: Callable[[str], Callable[..., Any] | None]) -> None:
        self._find = find
        self._pages: set[str] = set()
        self._page = ""
        self._taken = 0

    def expect_page(self) -> None:
        """A page is being loaded, and the one before is to know at once that it has been replaced."""
        self._page = ""

    def is_of(self, page: str) -> bool:
        """Whether it is this page that is served."""
        return page != "" and page == self._page

    def __call__(self, page: str, number: int, name: str, arguments: Sequence[Any] = ()) -> Any:
        """Answer a request; None if it was answered before, or is from a page that has been replaced.

        Args:
            page: a name that only this page has, which has the session from its first request on.
            number: of the request.
            name: what answers it.
            arguments: for that.
        """
        if page not in self._pages:
            self._pages.add(page)
            self._page, self._taken = page, 0
        if not self.is_of(page) or number <= self._taken:
            return None
        self._taken = number
        answer = self._find(name)
        return None if answer is None else answer(*arguments)
