"""One session per server: which browser it belongs to, and whether that browser is there."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Awaitable, Callable

from aiohttp import WSCloseCode, web

COOKIE = "vittf"

SECONDS_TO_RETURN = 20.0
"""From the closing of a tab to the end of the session. A page that is loaded again, or a tab that was closed by mistake, is
back within seconds."""
SECONDS_TO_RECONNECT = 24 * 3600.0
"""From a connection that broke to the end of the session. The computer slept, say, and its user goes on tomorrow; but a browser
that crashed, or that was killed, says nothing either, and its session is not to stay for ever."""


class BrowserSession:
    """The browser that has the session, known by a cookie that only it was given.

    Its page is there as long as its websocket is open. Another browser may have the session once that is closed.

    Args:
        on_left: called in the running loop once the tab was closed and did not come back, or long after its connection broke;
            not while the browser still fetches something.
    """

    def __init__(self, on_left: Callable[[], object]) -> None:
        self._on_left = on_left
        self._key: str | None = None
        self._socket: web.Request | None = None
        self._farewell: asyncio.TimerHandle | None = None
        self._patience_s = SECONDS_TO_RETURN
        self._answering = 0

    def is_owner(self, request: web.Request) -> bool:
        """Whether a request is from the browser that has the session."""
        return self._key is not None and secrets.compare_digest(request.cookies.get(COOKIE, "").encode(), self._key.encode())

    def is_free(self) -> bool:
        """Whether no page is there, so that another browser may have the session."""
        return self._socket is None

    def give_to(self, response: web.StreamResponse) -> None:
        """Make the browser that gets `response`, which is the page, the one that has the session; any other loses it."""
        self._key = secrets.token_urlsafe()
        # Without a path, it is for the folder that the browser has the page from: a proxy may have put others before that.
        # Lax: a browser that comes by a link, or by an address clicked in a mail, is to be known again.
        response.set_cookie(COOKIE, self._key, path="", httponly=True, samesite="Lax")

    async def hold(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Serve the websocket of the owner's page, which is there until it ends.

        Of two pages in one browser, the one that was opened last has the session: they would quarrel about the size of views.
        """
        previous, self._socket = self._socket, request
        if previous is not None and previous.transport is not None:
            # Not closed: that would wait until a browser that is not heard any more has taken what was sent to it.
            previous.transport.abort()
        self._stay()
        response = None
        try:
            response = await handler(request)
        finally:
            if self._socket is request:
                self._socket = None
                if isinstance(response, web.WebSocketResponse) and response.close_code == WSCloseCode.GOING_AWAY:
                    self.part()
                elif self._farewell is None:
                    self._wait(SECONDS_TO_RECONNECT)
        return response

    async def answer(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Serve any other request of the owner's: whoever asks is there, as is a browser that still fetches what was saved."""
        if self._farewell is not None:
            self._wait(self._patience_s)
        self._answering += 1
        try:
            return await handler(request)
        finally:
            self._answering -= 1

    def part(self) -> None:
        """The owner's page is being closed, or loaded again.

        It says so itself as well: the code with which its websocket ends is lost where the browser is faster than this server,
        which then cannot answer it.
        """
        self._wait(SECONDS_TO_RETURN)

    def _wait(self, seconds: float) -> None:
        self._stay()
        self._patience_s = seconds
        self._farewell = asyncio.get_running_loop().call_later(seconds, self._leave)

    def _leave(self) -> None:
        self._farewell = None
        # There may be another page meanwhile, in the same browser: then only one of its tabs was closed.
        if self._socket is not None:
            return
        if self._answering:
            self._wait(self._patience_s)
        else:
            self._on_left()

    def _stay(self) -> None:
        if self._farewell is not None:
            self._farewell.cancel()
            self._farewell = None
