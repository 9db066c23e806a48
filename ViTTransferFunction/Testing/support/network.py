"""A network between a browser and a server, which tests interrupt."""

from __future__ import annotations

import selectors
import socket
import threading
from collections.abc import Callable
from contextlib import suppress


class Network:
    """Relays connections to a server of this computer, until `close`.

    Args:
        port: of the server.
        change: what becomes of all that the browser sends; by default, nothing.

    Attributes:
        port: where it listens.
    """

    def __init__(self, port: int, change: Callable[[bytes], bytes] = lambda data: data) -> None:
        self._server = port
        self._change = change
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._pairs: list[tuple[socket.socket, socket.socket]] = []
        self._silent: set[int] = set()
        self._drops_requests = False
        self._is_down = False
        threading.Thread(target=self._accept, daemon=True).start()

    def go_down(self, *, after_sending: bool = True) -> None:
        """Break all connections off, and let none through until `come_up`.

        Args:
            after_sending: if False, what the browser sends is lost from now on, and the connections break with the next of it.
        """
        self._is_down, self._drops_requests = True, not after_sending
        if after_sending:
            self._break_off()

    def come_up(self) -> None:
        """Let new connections through; those that broke stay broken."""
        self._break_off()
        self._is_down = self._drops_requests = False

    def fall_silent(self) -> None:
        """Let nothing through over the connections that are there, in either direction, without a word to both ends."""
        self._silent = {id(pair) for pair in self._pairs}

    def close(self) -> None:
        self._is_down = True
        self._listener.close()
        self._break_off()

    def _break_off(self) -> None:
        for pair in self._pairs:
            for end in pair:
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while self._listener.fileno() >= 0:
            with suppress(OSError):
                browser, _ = self._listener.accept()
                if self._is_down:
                    browser.close()
                    continue
                self._pairs.append((browser, socket.create_connection(("127.0.0.1", self._server))))
                threading.Thread(target=self._relay, args=(self._pairs[-1],), daemon=True).start()

    def _relay(self, pair: tuple[socket.socket, socket.socket]) -> None:
        browser, server = pair
        with selectors.DefaultSelector() as selector, browser, server, suppress(OSError):
            selector.register(browser, selectors.EVENT_READ, server)
            selector.register(server, selectors.EVENT_READ, browser)
            while True:
                for key, _ in selector.select():
                    data = key.fileobj.recv(1 << 16)  # type: ignore[union-attr]
                    if not data or (self._drops_requests and key.fileobj is browser):
                        return
                    if id(pair) not in self._silent:
                        key.data.sendall(self._change(data) if key.fileobj is browser else data)
