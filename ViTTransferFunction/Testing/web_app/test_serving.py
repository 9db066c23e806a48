"""The page's web server by itself."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

pytest.importorskip("trame_slicer.core")
import aiohttp
from trame.app import get_server

from ViTTransferFunction.WebApp.access import Access
from ViTTransferFunction.WebApp.serving import Serving

BROKEN_OFF = 64


@pytest.mark.parametrize("times", [1, 2])
def test_a_connection_that_is_broken_off_while_it_is_let_in_keeps_no_others_out(
    times: int, caplog: pytest.LogCaptureFixture
) -> None:
    """On Windows, asyncio closes the socket that it listens at then."""

    async def journey() -> None:
        server = get_server(f"broken off {times}", client_type="vue3")
        bound: list[Any] = []
        ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        server.controller.on_server_bind.add(bound.append)
        server.controller.on_server_ready.add(lambda **_: ready.set_result(None))
        access = Access()
        serving = Serving(server, access, 0)
        await asyncio.wait_for(ready, 60.0)
        for _ in range(times):
            _break_off_while_let_in(bound[0].runner)
            assert await asyncio.wait_for(_status(access.address(server.port)), 60.0) == 200
        await serving.end()

    asyncio.run(journey())
    assert not caplog.records


async def _status(address: str) -> int:
    """Of the answer, once somebody listens."""
    async with aiohttp.ClientSession() as browser:
        while (status := await _answer(browser, address)) is None:
            await asyncio.sleep(0.01)
        return status


async def _answer(browser: aiohttp.ClientSession, address: str) -> int | None:
    try:
        async with browser.get(address) as response:
            return response.status
    except aiohttp.ClientConnectorError:
        return None


def _break_off_while_let_in(runner: Any) -> None:
    """What a loop of Windows does (`BaseProactorEventLoop._start_serving`)."""
    error = OSError(22, "The specified network name is no longer available")
    error.winerror = BROKEN_OFF  # type: ignore[attr-defined]
    asyncio.get_running_loop().call_exception_handler({"message": "Accept failed on a socket", "exception": error})
    for site in runner.sites:
        site._server.close()
