"""The app's picture in the README: a saved session with six organs, opened and computed in a real browser."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from trame_slicer.core import SlicerApp

from ViTTransferFunction.Logic.core.system.cache_folder import CACHE_VARIABLE, cache_folder
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.readme_pictures.composition import save_small
from ViTTransferFunction.Testing.support.readme_pictures.desk import MODEL
from ViTTransferFunction.Testing.support.readme_pictures.scans import ABDOMEN_CT
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.web_app import AppPage, serving
from ViTTransferFunction.WebApp.scene_files import parameter_node

WIDTH, HEIGHT = 1280, 800
SELECTED = "right kidney"
SLICES_MM = {"Red": 1058.0, "Green": -270.0, "Yellow": -78.0}
"""Where the slices lie, in the kidneys; the sagittal one in the right one."""
STILL_S = 10.0
"""A picture that has been the same for so long is the last one of its view, and the sharp one."""


def draw_app(data: Path, out: Path, annotations: Path) -> None:
    """Draw the page with the organs of the opening picture.

    Args:
        data: folder with the scan.
        out: folder for the picture.
        annotations: file with the points.
    """
    from playwright.sync_api import sync_playwright

    # The server of the tests would have a cache of its own.
    os.environ[CACHE_VARIABLE] = str(cache_folder())
    with tempfile.TemporaryDirectory(prefix="vittf-") as folder, sync_playwright() as playwright:
        session = Path(folder) / "abdomen.mrb"
        _write_session(session, data, annotations)
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium") or shutil.which("google-chrome"), args=["--disable-dev-shm-usage"]
        )
        with serving(session, "--model", MODEL, "--device", "cpu", cache=Path(folder)) as server:
            page = AppPage(browser.new_context(viewport={"width": WIDTH, "height": HEIGHT}).new_page(), Path(folder))
            page.page.goto(server.address)
            save_small(_picture(page), out / "app.webp")
        browser.close()


def _write_session(path: Path, data: Path, annotations: Path) -> None:
    """A session with the points, and nothing computed yet."""
    app, volume = SlicerApp(), ABDOMEN_CT.read(data)
    session = SceneSession(app.scene, app.app_logic, parameter_node(app.scene))
    session.parameters.set("model", MODEL)
    session.set_volume(add_volume(app.scene, volume))
    for given in read_annotations(annotations, volume.geometry):
        id_ = session.annotations.add_class(given.name, given.color).id
        session.annotations.add_points(id_, given.request.positive, positive=True)
        session.annotations.add_points(id_, given.request.negative, positive=False)
        if given.name == SELECTED:
            session.select_class(id_)
    session.close()
    app.scene.WriteToMRB(path.as_posix())


def _picture(page: AppPage) -> np.ndarray:
    page.wait_for_state("classes.length > 0 && opening === '' && (phase === 'ready' || phase === 'no features')")
    if page.page.evaluate("window.trame.state.get('phase')") != "ready":
        page["extract"].click()
    page.wait_for_state("phase === 'ready' && up_to_date && !busy")
    page["window-0"].click()
    for view, slice_mm in SLICES_MM.items():
        page[f"slice-{view}"].fill(str(slice_mm))
    page["open"].scroll_into_view_if_needed()
    page.page.mouse.move(WIDTH / 2, HEIGHT / 2)
    last, since = _pixels(page), time.monotonic()
    while time.monotonic() < since + STILL_S:
        page.wait_for_drawing()
        picture = _pixels(page)
        if not np.array_equal(picture, last):
            last, since = picture, time.monotonic()
    return last


def _pixels(page: Any) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.page.screenshot(animations="disabled"))).convert("RGB"))
