"""3D pictures that a processor draws are coarse while something moves, and sharp at rest."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("psutil")

from PIL import Image

from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.web_app import AppPage
from ViTTransferFunction.WebApp import sharpness
from ViTTransferFunction.WebApp.sharpness import COARSE_PIXELS, SHARP_S, SharpAtRest

COARSE = (250, 160)
SHOWN = (1000, 640)
"""Sizes: of the view's coarse pictures, and of these on the page."""


class Adapter:
    """Takes a view's pictures, and lets one wait for the next: its size."""

    scale_factor = COARSE[0] / SHOWN[0]
    max_pixel_count = 0

    def __init__(self) -> None:
        self.pushed = asyncio.Queue[tuple[int, int]]()

    def push(self, content: bytes, metadata: dict[str, Any]) -> None:
        assert (metadata["type"], metadata["quality"]) == ("image/jpeg", 90)
        self.pushed.put_nowait(Image.open(io.BytesIO(content)).size)

    async def next(self) -> tuple[int, int]:
        return await asyncio.wait_for(self.pushed.get(), LONGEST_WAIT_S)


def sharp_at_rest(adapter: Adapter, *seconds: float, is_busy: Callable[[], bool] = lambda: False) -> SharpAtRest:
    """Of a view whose renderers took so long for the last picture."""
    renderers = [SimpleNamespace(GetLastRenderTimeInSeconds=lambda value=value: value) for value in seconds]
    window = SimpleNamespace(GetRenderers=lambda: renderers, GetSize=lambda: COARSE)
    return SharpAtRest(SimpleNamespace(render_window=lambda: window), adapter, is_busy, 90)


async def rests_pass() -> None:
    await asyncio.sleep(5 * sharpness.REST_S)


@pytest.fixture(autouse=True)
def short_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharpness, "REST_S", 0.02)
    monkeypatch.setattr(sharpness, "view_picture", lambda window, size: np.zeros((size[1], size[0], 3), np.uint8))


def run(journey: Callable[[Adapter], Coroutine[Any, Any, None]]) -> None:
    async def begun() -> None:
        await journey(Adapter())

    asyncio.run(begun())


def test_a_view_at_rest_is_sharp_each_time_that_it_has_changed() -> None:
    async def journey(adapter: Adapter) -> None:
        view = sharp_at_rest(adapter, -1.0, 0.01 * SHARP_S)
        assert adapter.max_pixel_count == COARSE_PIXELS
        for _ in range(2):
            view.change()
            assert await adapter.next() == SHOWN
            await rests_pass()
            assert adapter.pushed.empty()

    run(journey)


def test_a_sharp_picture_has_no_more_pixels_than_can_be_drawn_in_time() -> None:
    async def journey(adapter: Adapter) -> None:
        sharp_at_rest(adapter, 0.001, SHARP_S / 9.0).change()
        assert await adapter.next() == (3 * COARSE[0], 3 * COARSE[1])

    run(journey)


def test_a_view_that_is_slow_stays_coarse() -> None:
    async def journey(adapter: Adapter) -> None:
        sharp_at_rest(adapter, 0.5 * SHARP_S).change()
        await rests_pass()
        assert adapter.pushed.empty()

    run(journey)


def test_a_sharp_picture_waits_while_something_is_under_way() -> None:
    async def journey(adapter: Adapter) -> None:
        done = asyncio.Event()
        sharp_at_rest(adapter, 0.01, is_busy=lambda: not done.is_set()).change()
        await rests_pass()
        assert adapter.pushed.empty()
        done.set()
        await adapter.next()

    run(journey)


def test_a_view_that_changes_again_and_again_is_not_drawn_sharply_in_between() -> None:
    async def journey(adapter: Adapter) -> None:
        view = sharp_at_rest(adapter, 0.01)
        for _ in range(10):
            view.change()
            await asyncio.sleep(0)
        await adapter.next()
        await rests_pass()
        assert adapter.pushed.empty()

    run(journey)


def test_a_view_says_that_it_is_being_drawn_sharply_for_as_long_as_that_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    async def journey(adapter: Adapter) -> None:
        view = sharp_at_rest(adapter, 0.01)
        said = []

        def drawn(_window: Any, size: tuple[int, int]) -> np.ndarray:
            said.append(view.drawing)
            return np.zeros((size[1], size[0], 3), np.uint8)

        monkeypatch.setattr(sharpness, "view_picture", drawn)
        view.change()
        await adapter.next()
        assert (said, view.drawing) == ([True], False)

    run(journey)


def test_a_view_that_outlives_the_app_draws_nothing_more() -> None:
    views = []

    async def journey(adapter: Adapter) -> None:
        views.append(sharp_at_rest(adapter, 0.01))

    run(journey)
    views[0].change()


@pytest.mark.slow
def test_in_a_browser_the_3d_view_at_rest_has_a_pixel_for_each_pixel_of_the_page(at_noise: AppPage) -> None:
    page = at_noise.page
    picture = 'document.querySelector("[data-testid=view-ThreeD] img")'
    sharp = f"{picture}?.naturalWidth >= {picture}?.clientWidth - 2"
    page.wait_for_function(sharp)
    page.evaluate(f"window.before = {picture}.src")
    box = at_noise["view-ThreeD"].bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 4, box["y"] + box["height"] / 4)
    # Also of a view that is held still.
    page.wait_for_function(f"{picture}.src !== window.before && {sharp}")
    page.mouse.up()
