"""A view comes to show its last picture, also in a browser that is too busy for each."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Testing.support.web_app import AppPage, changed_share
from ViTTransferFunction.WebApp import picture_delivery

SLOW_DECODING = """() => {
    const src = Object.getOwnPropertyDescriptor(HTMLImageElement.prototype, "src");
    Object.defineProperty(HTMLImageElement.prototype, "src", {
        get() { return src.get.call(this); },
        set(url) {
            // Those that are decoded on the way to a view are in no document.
            if (this.isConnected) src.set.call(this, url);
            else setTimeout(() => src.set.call(this, url), 2000);
        },
    });
}"""
"""Has each picture of a view take a while, as in a browser whose computer does something else."""

SLIDE = "(slider, to) => { slider.value = to; slider.dispatchEvent(new Event('input')); }"


def test_a_picture_is_sent_again_unless_a_newer_one_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[tuple[Any, ...]] = []
    adapter = SimpleNamespace(streamer=None)
    adapter.set_streamer = lambda streamer: setattr(adapter, "streamer", streamer)
    monkeypatch.setattr(picture_delivery, "AGAIN_AFTER_S", (0.0, 0.0))

    async def two_pictures() -> None:
        picture_delivery.send_last_again(adapter)
        adapter.set_streamer(SimpleNamespace(push_content=lambda *picture: sent.append(picture)))
        adapter.streamer.push_content("Red", {"type": "image/jpeg"}, b"first")
        adapter.streamer.push_content("Red", {"type": "image/jpeg"}, b"last")
        while asyncio.all_tasks() - {asyncio.current_task()}:
            await asyncio.sleep(0)

    asyncio.run(two_pictures())
    assert sent == [("Red", {"type": "image/jpeg"}, content) for content in (b"first", *3 * [b"last"])]
    adapter.set_streamer(None)
    assert adapter.streamer is None


@pytest.mark.slow
def test_the_last_of_many_pictures_is_shown_though_the_page_drops_some(at_noise: AppPage) -> None:
    page = at_noise
    slider = page["slice-Red"]
    low, high = (float(slider.get_attribute(end) or "") for end in ("min", "max"))

    def go_to(share: float) -> None:
        slider.evaluate(SLIDE, low + share * (high - low))

    # It is drawn first before it is fitted to its view, and then has margins.
    start = page.wait_for_picture("Red", lambda picture: picture.std() > 20 and bool(picture[60:150, -20:].max() < 20))
    go_to(0.9)
    expected = page.wait_for_picture("Red", lambda picture: changed_share(start, picture) > 0.2)
    go_to(0.5)
    page.wait_for_picture("Red", lambda picture: changed_share(expected, picture) > 0.2)

    page.page.evaluate(SLOW_DECODING)
    for step in range(41):
        go_to(0.5 + 0.01 * step)
        page.page.wait_for_timeout(25)
    page.wait_for_picture("Red", lambda picture: changed_share(expected, picture) < 0.02)
