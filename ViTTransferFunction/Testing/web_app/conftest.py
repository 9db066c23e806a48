"""The app without a browser, and a real browser without a window with pages of the app in it."""

from __future__ import annotations

import asyncio
import os
import shutil
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from ViTTransferFunction.CommandLine.library_file_names import take_utf8_file_names

# As `vittf app` does.
take_utf8_file_names()

BROWSER_IS_REQUIRED = os.environ.get("VITTF_REQUIRE_BROWSER") == "1"
PICTURES = os.environ.get("VITTF_APP_PICTURES")
"""Folder for a picture of each step of the tests; else pytest's temporary folder."""

Journey = Callable[[Any], Coroutine[Any, Any, None]]
"""What is done to a `WebApp`."""

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, or what is made of it, driven by Playwright."""
    # Within the fixture, since tests that run a loop of their own cannot do so beside Playwright's.
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        _missing("the Python package playwright is not installed")
    with sync_playwright() as playwright:
        own = playwright.chromium.executable_path
        path = next(filter(None, map(shutil.which, NAMES)), own if Path(own).exists() else None)
        if path is None:
            _missing(f"no browser was found: none of {', '.join(NAMES)}, nor one of `playwright install chromium`")
        # Containers have little shared memory.
        browser = playwright.chromium.launch(executable_path=path, args=["--disable-dev-shm-usage"], timeout=180_000)
        yield browser
        browser.close()


def _missing(reason: str) -> Any:
    if BROWSER_IS_REQUIRED:
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """The folder for the pictures of a test file's steps, without those of an earlier run."""
    folder = Path(PICTURES or tmp_path_factory.mktemp("pictures")) / request.module.__name__.rpartition(".")[2]
    for old in folder.glob("[0-9][0-9] *.png"):
        old.unlink()
    return folder


@pytest.fixture
def new_page(browser: Any, pictures: Path) -> Iterator[Callable[[], Any]]:
    """Opens a page in a browser of its own: one that shares nothing with the others."""
    from ViTTransferFunction.Testing.support.web_app import AppPage

    pages: list[AppPage] = []
    contexts: list[Any] = []

    def open_one() -> AppPage:
        contexts.append(browser.new_context(viewport={"width": 1280, "height": 800}))
        pages.append(AppPage(contexts[-1].new_page(), pictures))
        return pages[-1]

    yield open_one
    for page in pages:
        if not page.page.is_closed():
            page.keep_picture("end")
    for context in contexts:
        context.close()
    assert not [error for page in pages for error in page.errors]


@pytest.fixture(scope="module")
def noise_server(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The app with a small volume of noise, for all tests of a file."""
    import numpy as np
    import SimpleITK as sitk  # noqa: N813

    from ViTTransferFunction.Testing.support.web_app import serving

    folder = tmp_path_factory.mktemp("app")
    sitk.WriteImage(sitk.GetImageFromArray(np.random.default_rng(0).normal(0.0, 8.0, (20, 22, 24))), str(folder / "noise.nrrd"))
    with serving(folder / "noise.nrrd", "--device", "cpu", cache=folder) as server:
        yield server


@pytest.fixture
def at_noise(new_page: Callable[[], Any], noise_server: Any) -> Any:
    """A page of it, which shows the volume."""
    page = new_page()
    page.page.goto(noise_server.address)
    page.wait_for_state("volume_name === 'noise' && opening === ''")
    return page


@pytest.fixture(scope="module")
def in_app(quick_compute_processes: None) -> Iterator[Callable[[Journey], None]]:
    """Runs journeys on one app, which takes seconds to make."""
    from ViTTransferFunction.WebApp.app import WebApp

    loop = asyncio.new_event_loop()

    async def make() -> WebApp:
        return WebApp()

    app = loop.run_until_complete(make())

    async def travel(journey: Journey) -> None:
        try:
            await journey(app)
        finally:
            # What is not saved goes to the cache of this test, which the next one does not share.
            app.unsaved_points.leave()
            await app.unsaved_points._done(lambda: None)
            # Nor does it begin with what went wrong in this one.
            app.close_messages()

    yield lambda journey: loop.run_until_complete(travel(journey))
    app.session.close()
    for task in asyncio.all_tasks(loop):
        task.cancel()
    loop.run_until_complete(asyncio.sleep(0))
    loop.close()


@pytest.fixture
def file(spheres: Any, tmp_path: Path) -> Path:
    """The volume of spheres."""
    import SimpleITK as sitk  # noqa: N813

    path = tmp_path / "spheres.nrrd"
    sitk.WriteImage(sitk.GetImageFromArray(spheres[0].array), str(path))
    return path


@pytest.fixture
def opened(in_app: Callable[[Journey], None], file: Path) -> Callable[[Journey], None]:
    """Runs a journey on an app that has the volume of spheres open."""

    def run(journey: Journey) -> None:
        async def go(app: Any) -> None:
            await app.opening.open([file])
            await journey(app)

        in_app(go)

    return run
