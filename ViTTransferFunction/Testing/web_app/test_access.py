"""Requests over real sockets, as browsers and others send them, to a server behind the door of the app."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import pytest

pytest.importorskip("aiohttp")
import aiohttp
from aiohttp import web

from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.WebApp import browser_session
from ViTTransferFunction.WebApp.access import Access

PAGE = "<html><script>first()</script><p>the page</p></html>"


class Place:
    """A guarded server: a page, a file, a route that takes uploads and a websocket that answers; and browsers that go there."""

    def __init__(self, folder: Path, host: str = "127.0.0.1") -> None:
        self.left: list[bool] = []
        self.uploaded: list[bytes] = []
        self.access = Access(host, on_left=lambda: self.left.append(True))
        (folder / "index.html").write_text(PAGE, encoding="utf-8")
        (folder / "script.js").write_text("1", encoding="utf-8")
        app = web.Application()
        self.access.guard(app, folder / "index.html")
        app.router.add_get(self.access.path("ws"), _echo)
        app.router.add_post(self.access.path("upload"), self._upload)
        app.router.add_get(self.access.path("endless"), _stream)
        app.router.add_static(self.access.path(), folder)
        self._runner = web.AppRunner(app)
        self.port = 0

    async def __aenter__(self) -> Place:
        await self._runner.setup()
        await web.TCPSite(self._runner, "127.0.0.1", 0).start()
        self.port = self._runner.addresses[0][1]
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._runner.cleanup()

    async def _upload(self, request: web.Request) -> web.Response:
        self.uploaded.append(await request.read())
        return web.Response()

    def url(self, name: str = "") -> str:
        return f"{self.root}{self.access.path(name)}"

    @property
    def origin(self) -> dict[str, str]:
        return {"Origin": self.root}

    @property
    def root(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    async def status(self, browser: aiohttp.ClientSession, name: str = "", **headers: str) -> int:
        async with browser.get(self.url(name), headers=headers) as response:
            return response.status

    async def socket_opens(self, browser: aiohttp.ClientSession, **headers: str) -> bool:
        try:
            async with browser.ws_connect(self.url("ws"), headers=headers) as socket:
                await socket.send_str("hello")
                return await socket.receive_str() == "hello"
        except aiohttp.WSServerHandshakeError:
            return False


async def _echo(request: web.Request) -> web.WebSocketResponse:
    socket = web.WebSocketResponse()
    await socket.prepare(request)
    async for message in socket:
        if message.data == "answer when I am gone":
            raise ConnectionResetError
        await socket.send_str(message.data)
    return socket


async def _stream(request: web.Request) -> web.StreamResponse:
    response = web.StreamResponse()
    await response.prepare(request)
    while True:
        await response.write(bytes(1 << 20))


def a_browser() -> aiohttp.ClientSession:
    return aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True))


@pytest.fixture
def at(tmp_path: Path) -> Callable[..., None]:
    """Runs a visit to a place."""

    def run(visit: Callable[[Place], Awaitable[None]], **arguments: Any) -> None:
        async def open_and_visit() -> None:
            async with Place(tmp_path, **arguments) as place:
                await visit(place)

        asyncio.run(open_and_visit())

    return run


def test_the_address_leads_to_the_page_with_its_files_uploads_and_websocket(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            async with browser.get(place.access.address(place.port)) as response:
                assert (response.status, await response.text()) == (200, PAGE)
            assert await place.status(browser, "script.js") == 200
            async with browser.get(place.url().rstrip("/")) as response:
                assert (str(response.url), await response.text()) == (place.url(), PAGE)
            assert await place.socket_opens(browser, **place.origin)
            async with browser.post(place.url("upload"), data=b"voxels", headers=place.origin) as response:
                assert response.status == 200
        assert place.uploaded == [b"voxels"]

    at(visit)


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/ws", "/upload", "/script.js", "/{wrong}/", "/{wrong}/ws", "/{token}x/", "//"]
)
def test_without_the_token_there_is_nothing(at: Callable[..., None], path: str) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            url = place.root + path.format(wrong="A" * 43, token=place.access.token)
            for method in ("GET", "POST", "PUT", "OPTIONS"):
                async with browser.request(method, url, headers=place.origin) as response:
                    assert response.status == 403
                    assert place.access.token not in await response.text()
                    assert not response.cookies

    at(visit)


@pytest.mark.parametrize(
    "lines", [("OPTIONS * HTTP/1.1", "Host: 127.0.0.1"), ("GET / HTTP/1.1", "Host: \xff"), ("GET / HTTP/1.0",),
              ("POST {path} HTTP/1.1", "Host: 127.0.0.1", "Origin: http://[", "Content-Length: 0")],
)  # fmt: skip
def test_what_no_browser_sends_is_refused_and_nothing_to_report(
    at: Callable[..., None], caplog: pytest.LogCaptureFixture, lines: tuple[str, ...]
) -> None:
    async def visit(place: Place) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", place.port)
        request = "\r\n".join((*lines, "", "")).format(path=urlsplit(place.url()).path)
        writer.write(request.encode("latin-1"))
        assert (await reader.readline()).split()[1] == b"403"
        writer.close()

    at(visit)
    assert not [record for record in caplog.records if record.exc_info]


def test_the_token_is_new_for_each_server_and_too_long_to_be_guessed() -> None:
    tokens = {Access().token for _ in range(10)}
    assert len(tokens) == 10
    assert all(len(token) >= 43 for token in tokens)


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "127.0.0.1@evil.example", "evil.example@127.0.0.1",
     "127.0.0.1:80:80", "127.0.0.1/evil.example", "localhost.evil.example", "[", ""],
)  # fmt: skip
def test_a_name_that_was_made_to_lead_here_is_refused(at: Callable[..., None], host: str) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            assert await place.status(browser, Host=host) in (400, 403)
            assert not await place.socket_opens(browser, Host=host, Origin=f"http://{host}")

    at(visit)


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost", "localhost:9000", "LOCALHOST", "[::1]:80", "192.168.0.7:80"])
def test_a_tunnel_may_have_another_port_and_numbers_need_no_name(at: Callable[..., None], host: str) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            assert await place.status(browser, Host=host) == 200

    at(visit)


def test_the_name_that_the_server_was_told_is_its_own(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            assert await place.status(browser, Host="gpu.hospital.example:80") == 200
            assert await place.status(browser, Host="evil.example") == 403

    at(visit, host="gpu.hospital.example")


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "file://", None])
def test_pages_of_other_servers_get_no_websocket_and_send_no_files(at: Callable[..., None], origin: str | None) -> None:
    async def visit(place: Place) -> None:
        headers = {} if origin is None else {"Origin": origin}
        async with a_browser() as browser:
            await place.status(browser)
            assert not await place.socket_opens(browser, **headers)
            async with browser.post(place.url("upload"), data=b"voxels", headers=headers) as response:
                assert response.status == 403
        assert not place.uploaded

    at(visit)


def test_whoever_has_the_address_but_not_the_session_gets_nothing_else(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as owner, a_browser() as other:
            await place.status(owner)
            assert await place.status(other, "script.js") == 409
            assert not await place.socket_opens(other, **place.origin)
            async with other.post(place.url("upload"), data=b"voxels", headers=place.origin) as response:
                assert response.status == 409
        assert not place.uploaded

    at(visit)


def test_a_second_browser_is_told_and_the_first_stays(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as owner, a_browser() as other:
            await place.status(owner)
            async with owner.ws_connect(place.url("ws"), headers=place.origin) as socket:
                async with other.get(place.url()) as response:
                    assert response.status == 409
                    assert "open in another browser" in await response.text()
                    assert not response.cookies
                await socket.send_str("still here")
                assert await socket.receive_str() == "still here"

    at(visit)


def test_once_the_first_browser_is_gone_another_may_have_the_session(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as owner, a_browser() as other:
            await place.status(owner)
            assert await place.socket_opens(owner, **place.origin)
            assert await place.status(other) == 200
            assert await place.socket_opens(other, **place.origin)
            assert not await place.socket_opens(owner, **place.origin)

    at(visit)


def test_a_page_that_is_loaded_again_keeps_the_session(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin):
                assert await place.status(browser) == 200
                assert await place.socket_opens(browser, **place.origin)

    at(visit)


def test_of_two_tabs_the_one_opened_last_has_the_session(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser, a_browser() as other:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin) as first:
                async with browser.ws_connect(place.url("ws"), headers=place.origin) as second:
                    message = await asyncio.wait_for(first.receive(), LONGEST_WAIT_S)
                    assert message.type in (aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.ERROR)
                    await second.send_str("here")
                    assert await second.receive_str() == "here"
                    assert await place.status(other) == 409
                assert not place.left

    at(visit)


@pytest.mark.parametrize("closed", [True, False])
def test_the_session_ends_when_the_tab_is_closed_but_not_when_the_connection_breaks(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch, closed: bool
) -> None:
    monkeypatch.setattr(browser_session, "SECONDS_TO_RETURN", 0.0)

    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin) as socket:
                if closed:
                    await socket.close(code=aiohttp.WSCloseCode.GOING_AWAY)
                else:
                    _transport_of(socket).abort()
            # Another browser is let in once the server has seen the end of the websocket.
            async with a_browser() as other:
                while await place.status(other) == 409:
                    pass
        assert bool(place.left) is closed

    at(visit)


@pytest.mark.parametrize("says_so_first", [True, False])
def test_a_page_says_that_it_is_closed_since_the_end_of_its_websocket_may_not_tell(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch, says_so_first: bool
) -> None:
    farewells = _farewells(monkeypatch)

    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin) as socket:
                if says_so_first:
                    assert await _leave(place, browser) == 204
                _transport_of(socket).abort()
            while not place.access._session.is_free():
                await asyncio.sleep(0)
            if not says_so_first:
                assert await _leave(place, browser) == 204
        (last,) = (farewell for farewell in farewells if not farewell.cancelled)
        assert last.delay == browser_session.SECONDS_TO_RETURN
        last.callback()
        assert place.left == [True]

    at(visit)


def test_the_session_of_a_browser_that_crashed_ends_in_the_end_whatever_its_pages_did_before(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    farewells = _farewells(monkeypatch)

    async def crash(place: Place, browser: aiohttp.ClientSession, *, a_tab_is_closed: bool) -> None:
        async with browser.ws_connect(place.url("ws"), headers=place.origin) as socket:
            if a_tab_is_closed:
                assert await _leave(place, browser) == 204
                farewells[-1].callback()
            _transport_of(socket).abort()
        while not place.access._session.is_free():
            await asyncio.sleep(0)
        assert (farewells[-1].delay, farewells[-1].cancelled) == (browser_session.SECONDS_TO_RECONNECT, False)

    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            for a_tab_is_closed in (False, False, True):
                await crash(place, browser, a_tab_is_closed=a_tab_is_closed)
            assert not place.left
        farewells[-1].callback()
        assert place.left == [True]

    at(visit)


def test_a_browser_that_is_gone_before_it_is_answered_is_nothing_to_report(
    at: Callable[..., None], caplog: pytest.LogCaptureFixture
) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin) as socket:
                await socket.send_str("answer when I am gone")
                await socket.receive()
        assert place.access._session.is_free()

    at(visit)
    assert not [record for record in caplog.records if record.exc_info]


def test_of_two_tabs_closing_the_first_leaves_the_session_to_the_other(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    farewells = _farewells(monkeypatch)

    async def visit(place: Place) -> None:
        async with a_browser() as browser, a_browser() as other:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin):
                assert await _leave(place, other) == 409
                assert not farewells
                assert await _leave(place, browser) == 204
                farewells[-1].callback()
                assert not place.left

    at(visit)


def test_the_session_does_not_end_while_the_browser_still_fetches_what_was_saved(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    farewells = _farewells(monkeypatch)

    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.get(place.url("endless")) as download:
                await download.content.readexactly(1)
                assert await _leave(place, browser) == 204
                (first,) = farewells
                first.callback()
                assert not place.left
            while place.access._session._answering:
                await asyncio.sleep(0)
            assert farewells[-1] is not first
            farewells[-1].callback()
        assert place.left == [True]

    at(visit)
    assert not [record for record in caplog.records if record.exc_info]


def test_a_page_that_loads_slowly_keeps_the_session_as_long_as_it_asks_for_more(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    farewells = _farewells(monkeypatch)

    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            assert await _leave(place, browser) == 204
            for name in ("", "script.js"):
                assert await place.status(browser, name) == 200
        assert [farewell.cancelled for farewell in farewells] == [True, True, False]
        assert farewells[-1].delay == browser_session.SECONDS_TO_RETURN

    at(visit)


async def _leave(place: Place, browser: aiohttp.ClientSession) -> int:
    async with browser.post(place.url("leave"), headers=place.origin) as response:
        return response.status


def _farewells(monkeypatch: pytest.MonkeyPatch) -> list[SimpleNamespace]:
    """What the session is to do later, which it does only when the test says so."""
    farewells: list[SimpleNamespace] = []

    def call_later(delay: float, callback: Callable[[], object]) -> SimpleNamespace:
        farewell = SimpleNamespace(delay=delay, callback=callback, cancelled=False)
        farewell.cancel = lambda: setattr(farewell, "cancelled", True)
        farewells.append(farewell)
        return farewell

    loop = SimpleNamespace(call_later=call_later)
    monkeypatch.setattr(browser_session, "asyncio", SimpleNamespace(get_running_loop=lambda: loop))
    return farewells


def _transport_of(socket: Any) -> asyncio.Transport:
    return socket.get_extra_info("transport", None) or socket._conn.transport


def test_a_page_that_comes_back_in_time_keeps_the_session_from_its_end(
    at: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    farewells = _farewells(monkeypatch)

    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.ws_connect(place.url("ws"), headers=place.origin) as socket:
                await socket.close(code=aiohttp.WSCloseCode.GOING_AWAY)
            async with browser.ws_connect(place.url("ws"), headers=place.origin):
                assert [farewell.cancelled for farewell in farewells] == [True]

    at(visit)


def test_every_answer_keeps_the_address_to_itself_and_only_the_page_runs_scripts(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            for name, status in (("", 200), ("script.js", 200), ("missing", 404), ("../wrong", 403)):
                async with browser.get(place.url(name)) as response:
                    assert response.status == status
                    assert response.headers["Referrer-Policy"] == "no-referrer"
                    assert response.headers["X-Content-Type-Options"] == "nosniff"
                    assert response.headers["X-Frame-Options"] == "DENY"
                    policy = response.headers["Content-Security-Policy"]
                    assert "default-src 'none'" in policy
                    assert ("script-src" in policy) == (name == "")
                    assert ("no-store" in response.headers["Cache-Control"]) == (status in (200, 403) and name != "script.js")

    at(visit)


def test_what_is_downloaded_may_lie_in_a_frame_of_the_page_and_of_no_other(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser:
            await place.status(browser)
            async with browser.get(place.url("download/session")) as response:
                assert response.headers["X-Frame-Options"] == "SAMEORIGIN"
                assert "frame-ancestors 'self'" in response.headers["Content-Security-Policy"]

    at(visit)


def test_scripts_in_the_page_are_allowed_by_their_hash_alone(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser, browser.get(place.url()) as response:
            policy = response.headers["Content-Security-Policy"]
            # printf 'first()' | openssl sha256 -binary | base64
            assert "'sha256-fDYmfWjvur9AxjhDbjHe6RvExc05MbXhhrbgz2vvy/A='" in policy
            assert f"connect-src 'self' ws://127.0.0.1:{place.port}" in policy
            assert "'unsafe-inline'" not in policy.partition("script-src")[2].partition(";")[0]

    at(visit)


def test_the_cookie_is_for_this_server_and_not_for_scripts(at: Callable[..., None]) -> None:
    async def visit(place: Place) -> None:
        async with a_browser() as browser, browser.get(place.url()) as response:
            (cookie,) = browser.cookie_jar
            assert cookie["path"] == place.access.path().rstrip("/")
            (cookie,) = response.cookies.values()
            assert cookie["httponly"]
            assert cookie["samesite"] == "Lax"

    at(visit)


@pytest.mark.parametrize("end", ["", "/"])
def test_a_proxy_may_serve_the_page_below_a_path_of_its_own(at: Callable[..., None], end: str) -> None:
    prefix = "/user/somebody/proxy/8080"

    async def visit(place: Place) -> None:
        async def forward(request: web.Request) -> web.Response:
            url, headers = place.root + request.path.removeprefix(prefix), request.headers
            async with (
                aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as session,
                session.get(url, headers=headers, allow_redirects=False) as answer,
            ):
                return web.Response(status=answer.status, headers=answer.headers, body=await answer.read())

        proxy = web.Application()
        proxy.router.add_get(f"{prefix}/{{route:.*}}", forward)
        runner = web.AppRunner(proxy)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        below = f"http://127.0.0.1:{runner.addresses[0][1]}{prefix}{place.access.path()}"
        async with a_browser() as browser:
            for address in (below.rstrip("/") + end, below + "script.js"):
                async with browser.get(address) as response:
                    assert response.status == 200
        await runner.cleanup()

    at(visit)


@pytest.mark.parametrize(
    ("host", "warns", "shown"),
    [("127.0.0.1", False, "127.0.0.1"), ("localhost", False, "localhost"), ("::1", False, "[::1]"),
     ("192.168.0.7", True, "192.168.0.7"), ("gpu", True, "gpu")],
)  # fmt: skip
def test_listening_to_others_is_said_and_the_address_names_the_host(host: str, warns: bool, shown: str) -> None:
    access = Access(host)
    assert bool(access.warning) is warns
    assert access.address(8080) == f"http://{shown}:8080/{access.token}/"


def test_listening_at_every_address_is_said_and_the_address_is_one_that_leads_somewhere() -> None:
    access = Access("0.0.0.0")
    assert "other computers can reach" in (access.warning or "")
    assert "0.0.0.0" not in access.address(8080)
