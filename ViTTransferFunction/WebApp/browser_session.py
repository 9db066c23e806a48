"""The single session of a server: which browser it belongs to, and whether that browser is connected."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Awaitable, Callable

from aiohttp import WSCloseCode, web

COOKIE = "vittf"

SECONDS_TO_RETURN = 20.0
"""Time from the closing of a tab to the end of the session. A page that is reloaded, or a tab that was closed by mistake, is
back within seconds."""
SECONDS_TO_RECONNECT = 24 * 3600.0
"""Time from a lost connection to the end of the session. The computer may have slept, and its user may continue the next day.
But a browser that crashed or was killed sends no notice either, and its session must not stay forever."""


class BrowserSession:
    """The browser that owns the session, identified by a cookie that only it was given.

    Its page is present while its websocket is open. When that is closed, another browser may take over the session.

    Args:
        on_left: called in the running loop when the tab was closed and did not come back, or long after the connection was
            lost; not while the browser is still downloading something.
    """

    def __init__(self, on_left: Callable[[], object]) -> None:
        self._on_left = on_left
        self._key: str | None = None
        self._socket: web.Request | None = None
        self._farewell: asyncio.TimerHandle | None = None
        self._patience_s = SECONDS_TO_RETURN
        self._answering = 0

    def is_owner(self, request: web.Request) -> bool:
        """Whether a request comes from the browser that owns the session."""
        return self._key is not None and secrets.compare_digest(request.cookies.get(COOKIE, "").encode(), self._key.encode())

    def is_free(self) -> bool:
        """Whether no page is present, so that another browser may take over the session."""
        return self._socket is None

    def give_to(self, response: web.StreamResponse) -> None:
        """Make the browser that receives `response`, the page, the owner of the session; any other browser loses it."""
        self._key = secrets.token_urlsafe()
        # With an empty path, the cookie applies to the folder of the page's address, which a proxy may have prefixed.
        # Lax: a browser that follows a link to the page, from an email for example, has to be recognised.
        response.set_cookie(COOKIE, self._key, path="", httponly=True, samesite="Lax")

    async def hold(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Serve the websocket of the owner's page, which is present until it ends.

        Of two pages in one browser, only the last opened one has the session, since each would set the size of the views.
        """
        previous, self._socket = self._socket, request
        if previous is not None and previous.transport is not None:
            # Closing would wait until an unreachable browser has received what was sent to it.
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
        """Serve any other request of the owner, who counts as present during it (a download, say) and for a while after."""
        if self._farewell is not None:
            self._wait(self._patience_s)
        self._answering += 1
        try:
            return await handler(request)
        finally:
            self._answering -= 1

    def part(self) -> None:
        """Handle a message that the owner's page is being closed or reloaded.

        The close code of the websocket is not enough: it is lost if the browser disconnects before this server can answer.
        """
        self._wait(SECONDS_TO_RETURN)

    def _wait(self, seconds: float) -> None:
        self._stay()
        self._patience_s = seconds
        self._farewell = asyncio.get_running_loop().call_later(seconds, self._leave)

    def _leave(self) -> None:
        self._farewell = None
        # Meanwhile there may be another page in the same browser: only one of its tabs was closed.
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
