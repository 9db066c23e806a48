"""The page's web server: where it listens, what is said of lost connections, and how it ends."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import sys
from contextlib import suppress
from typing import Any

from ..Logic.core.system.errors import InputError
from .access import Access

HEART_BEAT_S = 180
"""How often the browser is asked whether it is there. It is given up after half of that without an answer: a browser that gets
no time from the processors is not gone."""
SECONDS_TO_END = 2.0
"""For files that are still being sent or fetched when the app ends. Then they are cut off: a browser that takes nothing any
more, since its computer sleeps say, does not hold up the end, and what is tidied up with it."""
_NETNAME_DELETED = 64
"""Windows' number for a connection that its other side broke off."""
_NOT_ACCEPTED = "Accept failed on a socket"
"""What asyncio's loop says before it closes the socket that it listens at (`BaseProactorEventLoop._start_serving`)."""


class Serving:
    """Serves a page from when it is made until `end`. To be made and used in a running asyncio loop.

    Args:
        server: trame's, with all that the page needs.
        access: who is let in.
        port: to listen at, at the host of `access`; 0 for a free one.
    """

    def __init__(self, server: Any, access: Access, port: int) -> None:
        self._server = server
        self._access = access
        self._port = port
        # Nearly all that is sent is pictures, which are compressed already.
        server.cli.set_defaults(nowscompress=True)
        server.options["ws_heart_beat"] = HEART_BEAT_S
        access.install(server)
        serving = server.start(
            host=access.host,
            port=port,
            timeout=0,
            thread=True,  # Signals are the caller's.
            open_browser=False,
            show_connection_info=False,
            disable_logging=True,
            exec_mode="coroutine",
        )
        asyncio.get_running_loop().set_exception_handler(self._handle)
        logging.getLogger("wslink.protocol").addFilter(_tells_no_lost_connection)
        self._task = asyncio.create_task(serving)

    async def until_any(self, *tasks: asyncio.Task[Any]) -> None:
        """Wait until one of these tasks ends, or the server does; raises what ended it.

        Raises:
            InputError: nothing can listen there.
        """
        await asyncio.wait({self._task, *tasks}, return_when=asyncio.FIRST_COMPLETED)
        try:
            for task in (*tasks, self._task):
                if task.done():
                    task.result()
        except OSError as error:
            raise InputError(
                f"Nothing can listen at {self._access.host}, port {self._port}: {_reason(error)}. Choose another port or host."
            ) from error

    async def end(self) -> None:
        """Serve no more; what is still under way then has a moment."""
        if self._task.done():
            return
        cut_off = asyncio.get_running_loop().call_later(SECONDS_TO_END, self._access.cut_off)
        with suppress(Exception):
            await self._server.stop()
        cut_off.cancel()
        self._task.cancel()

    def _handle(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle what a task ended with: that the browser was gone when pictures were sent to it is nothing to report."""
        if not _is_lost_connection(context.get("exception")):
            loop.default_exception_handler(context)
        elif context.get("message") == _NOT_ACCEPTED:
            # Windows' loop listens no more once a browser broke off while it was let in (python/cpython#93821): nobody could
            # come back. It closes the socket when this returns.
            loop.call_soon(self._listen_again)

    def _listen_again(self) -> None:
        self._listening = asyncio.ensure_future(self._access.listen_again(self._server.port))


def _reason(error: OSError) -> str:
    """Why a port cannot be had, in the system's words."""
    if not error.errno:
        return str(error)
    if isinstance(error, socket.gaierror):
        return error.strerror or str(error)  # The numbers of these are none of the C library's.
    if sys.platform == "win32":
        import ctypes

        # What is wrong with sockets has numbers that the C library does not know.
        return ctypes.FormatError(error.errno).rstrip(".")
    return os.strerror(error.errno)


def _tells_no_lost_connection(record: logging.LogRecord) -> bool:
    """Whether a line of the log is of something else; for a filter. It is written where the error is handled."""
    return not _is_lost_connection(sys.exc_info()[1])


def _is_lost_connection(error: object) -> bool:
    return isinstance(error, ConnectionError) or getattr(error, "winerror", None) == _NETNAME_DELETED
