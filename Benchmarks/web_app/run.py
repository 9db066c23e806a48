"""How long a click in a browser takes until the browser shows its overlay.

    python dev.py bench web_app

Needs Chromium. `vittf app` runs on this computer with the browser beside it, which draws without a graphics card and takes its
share of the processor; a network is not part of it. The volume and its features are made up
(`Benchmarks/interaction/made_up_volume.py`), at 64³ cells with 384 channels. Each click is the first point of a structure. The
page itself looks at the axial view as often as it draws, and says when the picture has changed around the click. Writes
`web_app.json` and `web_app.md`.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK as sitk  # noqa: N813

from Benchmarks.interaction.made_up_volume import CELLS, cache_features, phantom
from Benchmarks.shared.arguments import benchmark_parser
from Benchmarks.shared.cache_of_its_own import cache_of_its_own
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Testing.support.web_app import AppPage, serving

WATCH = """
([column, row]) => {
  const view = document.querySelector('[data-testid="view-Red"]');
  const box = view.getBoundingClientRect();
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 61;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const look = () => {
    context.drawImage(view.querySelector('img[src^="blob:"]'), column - 30, row - 30, 61, 61, 0, 0, 61, 61);
    return context.getImageData(0, 0, 61, 61).data;
  };
  const before = look();
  // Not at the click itself: the point hung on the mouse before.
  const change = () => {
    const now = look();
    let sum = 0, count = 0;
    for (let y = 0; y < 61; y++) for (let x = 0; x < 61; x++) {
      const distance = Math.hypot(x - 30, y - 30);
      if (distance < 12 || distance > 30) continue;
      const at = 4 * (61 * y + x);
      for (let part = 0; part < 3; part++) sum += Math.abs(now[at + part] - before[at + part]);
      count += 3;
    }
    return sum / count;
  };
  window.measured = new Promise((resolve) => {
    window.addEventListener("mousedown", (event) => {
      const began = event.timeStamp;
      const watch = () => {
        const now_ms = performance.now() - began;
        if (change() > 8) resolve(now_ms);
        else if (now_ms > 20000) resolve(null);
        else requestAnimationFrame(watch);
      };
      watch();
    }, { capture: true, once: true });
  });
}
"""
"""Looks at the view from a click on, at a place in its pixels; the promise `measured` has the milliseconds."""

BALL = 0.3
"""Where the first ball has its middle, along each axis of the volume, which is the view's width and height."""

READY = "phase === 'ready' && !busy && opening === ''"


def main() -> None:
    """Measure, and write what was measured."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--size", type=int, default=256, help="voxels along each edge of the volume (default 256)")
    parser.add_argument("--clicks", type=int, default=20, help="clicks that are timed (default 20)")
    options = parser.parse_args()
    with cache_of_its_own() as cache:
        path = cache / "phantom.nrrd"
        sitk.WriteImage(sitk.GetImageFromArray(phantom((options.size,) * 3).array), str(path))
        cache_features(read_volume(path))
        measured = {
            "machine": machine(),
            "volume": options.size,
            "cells": CELLS,
            **measure_clicks(path, Path(cache), options.clicks),
        }
    write_results(options.results, "web_app", measured, text(measured))


def measure_clicks(volume: Path, cache: Path, clicks: int) -> dict[str, Any]:
    """Milliseconds from the mouse's button to the pictures in the browser."""
    from playwright.sync_api import sync_playwright

    with serving(volume, cache=cache) as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium") or shutil.which("google-chrome"), args=["--disable-dev-shm-usage"]
        )
        page = AppPage(browser.new_page(viewport={"width": 1280, "height": 800}), cache)
        page.page.goto(server.address)
        page.wait_for_state(READY)
        _show_a_ball(page)
        rng = np.random.default_rng(0)
        # The first one has everything loaded.
        _, *milliseconds = [_timed_click(page, rng.uniform(-0.05, 0.05, 2)) for _ in range(clicks + 1)]
        browser.close()
    return {
        "overlay_ms": milliseconds,
        "summary": {"overlay_ms": float(np.median(milliseconds)), "overlay_worst_ms": max(milliseconds)},
    }


def _show_a_ball(page: AppPage) -> None:
    """Have the axial view show the slice through the middle of the ball at `BALL`."""
    program = "(slider, share) => { slider.value = share * slider.max; slider.dispatchEvent(new Event('input')); }"
    page["slice-Red"].evaluate(program, BALL)
    page.page.wait_for_timeout(1000)


def _timed_click(page: AppPage, aside: np.ndarray) -> float:
    """Add a structure, click on the ball, as far from its middle as `aside`, and take the structure away again."""
    page["add-class"].click()
    page.wait_for_state(f"{READY} && classes.length === 1")
    box = page["view-Red"].bounding_box()
    # The volume fills the view's height, in its middle.
    beside = (box["width"] - box["height"]) / 2
    column, row = (round(box["height"] * (BALL + part)) for part in aside)
    column += round(beside)
    page.page.mouse.move(box["x"] + column, box["y"] + row)
    # The point hangs on the mouse by now, and nothing moves any more.
    page.page.wait_for_timeout(1500)
    page.page.evaluate(WATCH, [column, row])
    page.page.mouse.down()
    page.page.mouse.up()
    measured: float | None = page.page.evaluate("window.measured")
    assert measured is not None, "the overlay did not come"
    page.wait_for_state(READY)
    page["class-remove-0"].click()
    page.wait_for_state(f"{READY} && classes.length === 0")
    return measured


def text(measured: dict[str, Any]) -> str:
    """The report for people."""
    summary = measured["summary"]
    return paragraphs(
        "# The app in a browser",
        f"{in_words(measured['machine'])}, the browser on the same processor.",
        f"{measured['volume']}³ voxels, {measured['cells']}³ cells, {len(measured['overlay_ms'])} clicks.",
        table(
            ["from the mouse's button to", "time"],
            [
                ["the overlay in the browser, median", f"{summary['overlay_ms']:.0f} ms"],
                ["the overlay in the browser, slowest", f"{summary['overlay_worst_ms']:.0f} ms"],
            ],
        ),
    )


if __name__ == "__main__":
    main()
