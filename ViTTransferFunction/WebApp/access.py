"""Controls access to the app: it is limited to people with the address that `vittf app` printed, one browser at a time.

Other users of the computer, and pages of other sites in the user's own browser, can reach the port as well. They are kept out
by the following:

- All paths begin with a random token, so nothing is found without the printed address. The token is in the path because a
  cookie is sent to every port of its host, including the servers of other users of the computer, unless its path is secret.
- The first browser gets a cookie, and owns the session (`BrowserSession`). Others who see the address later, for example in the
  list of processes, cannot use it meanwhile.
- The `Host` of a request must be an IP address or a name of this computer: a page of another site whose name was made to
  resolve to this computer (DNS rebinding) sends its own name.
- Websockets, and all requests that change something, must come from a page of this server, as their `Origin` says.
"""

from __future__ import annotations

import html
import ipaddress
import re
import secrets
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from aiohttp import web

from .browser_session import BrowserSession
from .security_headers import add_security_headers, page_policy

LOOPBACK = "127.0.0.1"
TOKEN_BYTES = 24
_LOADER = re.compile(r"<script>\s*fetch\(\"\./loading\.tpl\"\).*?</script>", re.DOTALL)
_LOADING = '<p style="margin: 45vh 0; text-align: center; font: 15px system-ui, sans-serif">Loading…</p>'
_SAFE_METHODS = ("GET", "HEAD")

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Access:
    """Lets requests from the network through to trame's server, or refuses them.

    Args:
        host: the name or address that the server listens at.
        on_left: called in the server's loop when the browser's tab was closed and did not come back, or long after its
            connection broke.
        on_entered: called in the server's loop when the page is sent to a browser, which then owns the session.
    """

    def __init__(
        self,
        host: str = LOOPBACK,
        on_left: Callable[[], object] = lambda: None,
        on_entered: Callable[[], object] = lambda: None,
    ) -> None:
        self.host = host
        # Without capitals, which trame's client does not preserve when it reconnects.
        self.token = secrets.token_hex(TOKEN_BYTES)
        self._session = BrowserSession(on_left)
        self._on_entered = on_entered
        self._web_server: Any = None
        # Looked up only if needed, because it queries the network, which takes long where there is none.
        of_this_computer = () if _is_loopback(host) else (socket.gethostname(), socket.getfqdn())
        self._names = {name.lower() for name in ("localhost", host, *of_this_computer)}

    @property
    def warning(self) -> str | None:
        """Warning for the user if other computers can reach the server; otherwise None."""
        if _is_loopback(self.host):
            return None
        return (
            f"Listening at {self.host}: other computers can reach this one. Whoever has the address sees the images, and can "
            "open files of this computer as you; the connection is not encrypted. Over a network that is not yours alone, "
            "leave out --host and use a tunnel: ssh -L PORT:127.0.0.1:PORT THIS_COMPUTER"
        )

    def address(self, port: int) -> str:
        """The secret address that gives access, for the user only."""
        host = socket.gethostname() if _is_any(self.host) else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{port}{self.path()}"

    def path(self, name: str = "") -> str:
        """The path at which a route such as `upload` is registered with the server; pages use the relative path."""
        return f"/{self.token}/{name}"

    def install(self, server: Any) -> None:
        """Guard trame's server. To be called once, after all modules were enabled and before the server starts."""
        from trame_client.module import vue3

        server.enable_module(vue3)
        # Trame's page requests all other files and its websocket relative to its own path.
        server.serve = {f"{self.token}/{route}": folder for route, folder in server.serve.items()} | {self.token: vue3.www}
        server.cli.set_defaults(ws=f"{self.token}/ws")

        def bind(web_server: Any) -> None:
            self._web_server = web_server
            self.guard(web_server.app, Path(vue3.www) / "index.html")

        server.controller.on_server_bind.add(bind)

    def cut_off(self) -> None:
        """Abort all connections, even while data are sent."""
        for connection in self._web_server.runner.server.connections:
            if connection.transport is not None:
                connection.transport.abort()

    async def listen_again(self, port: int) -> None:
        """Listen for new connections again, at the same port; existing connections continue."""
        runner = self._web_server.runner
        for site in runner.sites:
            await site.stop()
        await web.TCPSite(runner, self.host, port).start()

    def guard(self, app: web.Application, page: Path) -> None:
        """Refuse requests to `app` by the rules in this file's first lines; `page` is the HTML file shown at the address."""
        html_of_page = _with_arrival(page.read_text(encoding="utf-8"))

        async def enter(request: web.Request) -> web.StreamResponse:
            headers = {"Content-Security-Policy": page_policy(html_of_page, request.host), "Cache-Control": "no-store"}
            response = web.Response(text=html_of_page, content_type="text/html", headers=headers)
            self._session.give_to(response)
            self._on_entered()
            return response

        async def leave(request: web.Request) -> web.StreamResponse:
            self._session.part()
            return web.Response(status=204)

        app.router.add_get(self.path(), enter)
        app.router.add_post(self.path("leave"), leave)
        app.router.add_post(self.path("paraview/"), _no_launcher)
        app.router.add_get(self.path().rstrip("/"), _to_folder)
        app.middlewares.insert(0, self._let_through)
        app.on_response_prepare.append(add_security_headers)

    @web.middleware
    async def _let_through(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if not self._is_named(request.host):
            return _refusal(403, "Not this computer", f"There is no {request.host} here. Use the address that was printed.")
        if not secrets.compare_digest(request.path.partition("/")[2].partition("/")[0].encode(), self.token.encode()):
            return _refusal(403, "No entry", "Open the whole address that vittf app printed where it was started.")
        is_websocket = request.headers.get("Upgrade", "").lower() == "websocket"
        if (is_websocket or request.method not in _SAFE_METHODS) and not _is_same_origin(request):
            return _refusal(403, "No entry", _of_another_origin(request))
        enters = request.method in _SAFE_METHODS and request.path in (self.path(), self.path().rstrip("/"))
        if not self._session.is_owner(request) and not (enters and self._session.is_free()):
            return _refusal(
                409, "Open elsewhere", "This session is open in another browser. Close it there, then load this page again."
            )
        serve = self._session.hold if is_websocket else self._session.answer
        try:
            return await serve(request, handler)
        except ConnectionError:
            # The browser was gone before it was answered, which need not be reported.
            return web.Response()

    def _is_named(self, host: str) -> bool:
        name = _name_of(host)
        return name is not None and (name in self._names or _is_number(name))


def _with_arrival(page: str) -> str:
    """Trame's page (HTML) with a script that reloads it if the connection breaks before the page is complete.

    Trame's own loading screen is fetched, and may arrive late and cover the page; the one in the HTML cannot.
    """
    script = (Path(__file__).parent / "static" / "arrival.js").read_text(encoding="utf-8")
    with_script = _LOADER.sub("", page).replace("<head>", f"<head><script>{script}</script>", 1)
    return with_script.replace('<div id="app"></div>', f'<div id="app">{_LOADING}</div>', 1)


async def _to_folder(request: web.Request) -> web.StreamResponse:
    raise web.HTTPFound(f"{request.path.rpartition('/')[2]}/")


async def _no_launcher(request: web.Request) -> web.StreamResponse:
    """Tell the page, which first looks for a launcher of servers, that there is none, so that it uses this server."""
    return web.json_response(None)


def _is_same_origin(request: web.Request) -> bool:
    host = request.host.lower()
    return request.headers.get("Origin", "").lower() in (f"http://{host}", f"https://{host}")


def _of_another_origin(request: web.Request) -> str:
    origin = request.headers.get("Origin")
    asked_by = f"This was asked for by a page of {origin}" if origin else "This was not asked for by a page"
    return (
        f"{asked_by}, but the app was called {request.host}. If the page is the app's own, a proxy lies between that changes "
        "the header Host: let it pass on what the browser sent."
    )


def _name_of(host: str) -> str | None:
    """The name in a `Host` header, in lower case and without the port; None if there is none."""
    match = re.fullmatch(r"(?:\[([0-9a-f:.]+)\]|([\w.-]+))(?::\d+)?", host.lower(), re.ASCII)
    return match and (match[1] or match[2])


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_loopback(host: str) -> bool:
    return host == "localhost" or (_is_number(host) and ipaddress.ip_address(host).is_loopback)


def _is_any(host: str) -> bool:
    return _is_number(host) and ipaddress.ip_address(host).is_unspecified


def _refusal(status: int, title: str, sentence: str) -> web.Response:
    """A plain page with a message; also the answer to websockets and uploads."""
    text = (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="color-scheme" content="light dark">'
        f"<title>{html.escape(title)}</title>"
        '<body style="font: 1.1rem/1.5 system-ui, sans-serif; max-width: 34rem; margin: 18vh auto; padding: 0 1.5rem">'
        f'<h1 style="font-size: 1.5rem">{html.escape(title)}</h1><p>{html.escape(sentence)}</p></body></html>'
    )
    # A header may contain bytes that are no valid text.
    body, headers = text.encode(errors="replace"), {"Cache-Control": "no-store"}
    return web.Response(status=status, body=body, content_type="text/html", charset="utf-8", headers=headers)
