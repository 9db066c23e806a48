"""What users do in the browser, on a made-up volume and a network of random weights: each test goes on from a fresh page."""

from __future__ import annotations

import http.client
import re
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from ViTTransferFunction.Testing.files.test_several_series import write_series, write_two
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.tiny_model import random_state_dict

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Testing.support.web_app import (
    SLOW_NETWORK,
    AppPage,
    Server,
    change_near,
    changed_share,
    is_painted,
    serving,
    still_running,
)

pytestmark = pytest.mark.slow
MODEL = "dinov2_vits14_focus"
REST_S = 2.0
"""For how long an app is watched that nobody uses."""
ENDING = ["SIGINT", "SIGTERM"]
"""Signals that end an app, by name."""
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
    ENDING.append("SIGHUP")
NewPage = Callable[[], AppPage]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Holds the volume, the weights, and what the servers cache."""
    import SimpleITK as sitk  # noqa: N813
    import torch

    from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS

    folder = tmp_path_factory.mktemp("app")
    torch.save(random_state_dict(PRETRAINED_MODELS[MODEL]), folder / "random.pt")
    shape, spacing_mm = (40, 48, 56), 2.0
    kji = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1)
    voxels = np.random.default_rng(0).normal(0.0, 8.0, shape)
    for centre, radius, intensity in (((20, 24, 18), 10, 200), ((20, 24, 40), 8, 100)):
        voxels[np.linalg.norm(kji - centre, axis=-1) < radius] += intensity
    image = sitk.GetImageFromArray(voxels.astype(np.int16))
    image.SetSpacing([spacing_mm] * 3)
    sitk.WriteImage(image, str(folder / "two balls.nrrd"))
    return folder


@pytest.fixture
def volume(folder: Path) -> Path:
    """The volume under a name that no test has opened before, by which a page tells that it is open."""
    return Path(shutil.copy(folder / "two balls.nrrd", folder / f"two balls {len(list(folder.glob('*.nrrd')))}.nrrd"))


@pytest.fixture(scope="module")
def options(folder: Path) -> list[str]:
    return ["--weights", str(folder / "random.pt"), "--model", MODEL, "--device", "cpu"]


@pytest.fixture(scope="module")
def server(browser: object, folder: Path, options: list[str]) -> Iterator[Server]:
    with serving(*options, "--grid", "8", cache=folder) as server:
        yield server


@pytest.fixture
def at_app(new_page: NewPage, server: Server) -> AppPage:
    """A page of the app. The browser before has left, so that it may have the session."""
    page = new_page()
    page.page.goto(server.address)
    page["app"].wait_for()
    return page


def open_volume(page: AppPage, path: Path) -> None:
    page["open"].click()
    page["open-path"].fill(str(path))
    page["open-path-go"].click()
    # Until features are found in the cache, or their cost is told, what is below moves.
    page.wait_for_state(f"volume_name === '{path.stem}' && opening === '' && !busy")


def extract(page: AppPage) -> None:
    page["extract"].click()
    page.wait_for_state("phase === 'ready'")


def drop(page: AppPage, path: Path) -> None:
    """Drop a file on the views, as from a file manager."""
    browser = page.page.context.new_cdp_session(page.page)
    for event in ("dragEnter", "dragOver", "drop"):
        data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
        browser.send("Input.dispatchDragEvent", {"type": event, "x": 900, "y": 400, "data": data})


def add_structure(page: AppPage, number: int) -> None:
    page["add-class"].click()
    page[f"class-{number}"].wait_for()


def click_at(page: AppPage, extent: tuple[int, int, int, int], i: float, j: float) -> tuple[float, float]:
    """Click in the axial view at a voxel; returns the pixel. The volume's axes are those of the view: to the left and back."""
    left, right, top, bottom = extent
    pixel = left + (i + 0.5) / 56 * (right - left), top + (j + 0.5) / 48 * (bottom - top)
    page.click_in("Red", *pixel)
    return pixel


def test_without_the_token_there_is_no_page(new_page: NewPage, server: Server) -> None:
    page = new_page()
    root = server.address.split("/")[2]
    for path in ("", "index.html", "ws", "x" * 43 + "/"):
        response = page.page.goto(f"http://{root}/{path}")
        assert response.status == 403
    page.keep_picture("no token")
    assert "whole address" in page.page.inner_text("body")


def test_before_anything_is_open_the_tab_key_leads_only_to_what_can_be_seen(at_app: AppPage) -> None:
    page = at_app
    page["welcome"].wait_for()
    reached, can_be_seen = "", True
    while reached != "open-sample":
        page.page.keyboard.press("Tab")
        reached, can_be_seen = page.page.evaluate(
            """() => {
              const one = document.activeElement, box = one.getBoundingClientRect();
              const seen = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
              return [one.dataset.testid ?? "", one.contains(seen)];
            }"""
        )
        assert can_be_seen


def test_a_volume_is_opened_clicked_at_corrected_refined_and_downloaded(at_app: AppPage, volume: Path, tmp_path: Path) -> None:
    import slicerio

    page = at_app
    page.keep_picture("welcome")
    open_volume(page, volume)
    extract(page)
    extent = page.extent_in("Red")
    page.keep_picture("features")
    add_structure(page, 0)
    before, before_3d = page.picture("Red"), page.picture("ThreeD")
    pixel = click_at(page, extent, 18, 24)
    page.wait_for_state("classes[0].positive === 1 && up_to_date")
    positive = page.wait_for_picture("Red", lambda picture: change_near(before, picture, *pixel) > 15)
    assert change_near(before, positive, extent[0] + 12, extent[2] + 12) < 5, "the overlay is everywhere"
    page.wait_for_picture("ThreeD", lambda picture: changed_share(before_3d, picture) > 0.02)
    page.keep_picture("a positive point")

    page["tool-pointOff"].click()
    outside = click_at(page, extent, 40, 24)
    page.wait_for_state("classes[0].negative === 1 && up_to_date")
    page.wait_for_picture("Red", lambda picture: change_near(positive, picture, *outside, radius=3) > 5)
    page.keep_picture("a negative point")
    page["refine"].uncheck()
    page.wait_for_state("!settings.refine && up_to_date")
    page["refine"].check()
    page.wait_for_state("settings.refine && up_to_date")

    page.rename(0, "bright ball")
    with page.page.expect_download():
        page["save-session"].click()
    page.wait_for_state("!unsaved")
    page["write-segments"].click()
    page.wait_for_state("written && progress === null")
    page.wait_for_state("unsaved")
    page.keep_picture("segments")
    with page.page.expect_download() as download:
        page["download-segmentation"].click()
    download.value.save_as(tmp_path / download.value.suggested_filename)
    assert download.value.suggested_filename == f"{volume.stem}.seg.nrrd"
    segmentation = slicerio.read_segmentation(str(tmp_path / download.value.suggested_filename))
    (segment,) = segmentation["segments"]
    assert segment["name"] == "bright ball"
    voxels = segmentation["voxels"] == segment["labelValue"]
    # The file has the axes i, j, k, and a crop of the volume at least as large as what was found.
    assert voxels.sum() > 500

    for box in ("class-visible-0", "overlayVisible"):
        page[box].uncheck()
    page.wait_for_state("!classes[0].visible && !busy")
    page.wait_for_drawing()
    assert is_painted(page.picture("Red"), *pixel)
    page["show-segments"].uncheck()
    page.wait_for_picture("Red", lambda picture: not is_painted(picture, *pixel))
    page.keep_picture("segments are hidden")
    for box in ("show-segments", "class-visible-0", "overlayVisible"):
        page[box].check()

    assert page["outdated"].count() == 0
    page.rename(0, "first ball")
    page["outdated"].wait_for()
    page.keep_picture("segments that are not up to date")
    with page.page.expect_download() as download:
        page["download-segmentation"].click()
    download.value.save_as(tmp_path / "updated.seg.nrrd")
    (segment,) = slicerio.read_segmentation(str(tmp_path / "updated.seg.nrrd"))["segments"]
    assert segment["name"] == "first ball"
    page["outdated"].wait_for(state="detached")
    assert page.page.evaluate("trame.state.get('download_due')") is False


def test_a_file_is_sent_by_the_browser_and_a_bad_one_gives_a_message(at_app: AppPage, folder: Path) -> None:
    page = at_app
    bad = folder / "notes.nrrd"
    bad.write_text("not an image", encoding="utf-8")
    for path, said in ((bad, "notes.nrrd"), (folder / "random.pt", "no known format")):
        page["open"].click()
        page["open-upload"].set_input_files(path)
        page["message"].wait_for()
        page.keep_picture("bad file")
        text = page["message"].inner_text()
        assert said in text
        assert "Traceback" not in text
        page["message-close"].click()
        page["message"].wait_for(state="detached")
    page["open"].click()
    page["open-upload"].set_input_files({
        "name": "sent.nrrd", "mimeType": "application/octet-stream", "buffer": (folder / "two balls.nrrd").read_bytes()
    })  # fmt: skip
    page.wait_for_state("volume_name === 'sent' && opening === ''")


def test_a_folder_of_several_series_is_sent_and_one_is_chosen(at_app: AppPage, volume: Path, folder: Path) -> None:
    page = at_app
    open_volume(page, volume)
    write_two(folder / "disk" / "series")
    page["open"].click()
    page["open-folder"].set_input_files(folder / "disk")
    page["series"].wait_for()
    page.keep_picture("which series")
    page.page.keyboard.press("Escape")
    page["series"].wait_for(state="detached")
    page.wait_for_state(f"volume_name === '{volume.stem}' && opening === ''")
    page["open"].click()
    page["open-folder"].set_input_files(folder / "disk")
    page["series-line"].filter(has_text="T1 axial").click()
    page.wait_for_state("volume_name === 'disk' && opening === ''")
    assert not page["message"].count()


def test_a_dropped_series_is_called_as_its_folder(at_app: AppPage, folder: Path) -> None:
    page = at_app
    write_series(folder / "patient 7", "2", "T1 axial", 3)
    drop(page, folder / "patient 7")
    page.wait_for_state("volume_name === 'patient 7' && opening === ''")


def test_files_that_did_not_arrive_are_told_of(at_app: AppPage, volume: Path) -> None:
    page = at_app
    page.page.route("**/upload*", lambda route: route.abort())
    page["open"].click()
    page["open-upload"].set_input_files(volume)
    page["message"].wait_for()
    assert "did not arrive" in page["message"].inner_text()


def test_who_clicks_without_features_is_told_what_is_missing(at_app: AppPage, folder: Path) -> None:
    import SimpleITK as sitk  # noqa: N813

    page, volume = at_app, folder / "not computed yet.nrrd"
    # Other noise each time: no cache has its features.
    sitk.WriteImage(sitk.GetImageFromArray(np.random.default_rng().normal(0.0, 8.0, (20, 22, 24))), str(volume))
    open_volume(page, volume)
    add_structure(page, 0)
    assert not page["features-missing"].count()
    page.click_in("Red", 200, 200)
    page["features-missing"].wait_for()
    page["extract"].click()
    page["features-missing"].wait_for(state="detached")


def test_a_page_that_is_loaded_again_while_it_sends_a_file_sends_none(at_app: AppPage, volume: Path, folder: Path) -> None:
    page = at_app
    open_volume(page, volume)
    large = folder / "large.raw"
    large.write_bytes(bytes(20_000_000))
    slow = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 1_000_000}
    page.page.context.new_cdp_session(page.page).send("Network.emulateNetworkConditions", slow)
    page["open"].click()
    page["open-upload"].set_input_files(large)
    page.page.wait_for_function("window.trame.state.get('sent') > 0")
    # Answered after all that the page told before.
    page["add-class"].evaluate("button => button.click()")
    page.wait_for_state("classes.length === 1")
    page.page.on("dialog", lambda dialog: dialog.accept())
    page.page.reload()
    page.wait_for_state("classes.length === 1")
    page.wait_for_drawing()
    assert not page.page.get_by_text("Sending files").count()


def test_what_is_dropped_closes_no_unsaved_structures_unasked(at_app: AppPage, volume: Path, folder: Path) -> None:
    page = at_app
    open_volume(page, volume)
    add_structure(page, 0)
    page.wait_for_state("classes.length === 1")
    shutil.copy(volume, folder / "dropped.nrrd")
    drop(page, folder / "dropped.nrrd")
    page["dropped"].wait_for()
    page.keep_picture("dropped")
    page.page.keyboard.press("Escape")
    page["dropped"].wait_for(state="detached")
    drop(page, folder / "dropped.nrrd")
    page["dropped"].wait_for()
    assert page.page.evaluate("[trame.state.get('volume_name'), trame.state.get('sent')]") == [volume.stem, None]
    with page.page.expect_download() as saving:
        page["dropped-save"].click()
    assert saving.value.suggested_filename == f"{volume.stem}.mrb"
    page["dropped-saved"].wait_for()
    page["dropped-open"].click()
    page.wait_for_state("volume_name === 'dropped' && opening === ''")
    # There is nothing to lose now.
    drop(page, volume)
    page.wait_for_state(f"volume_name === '{volume.stem}' && opening === ''")


def test_over_a_slow_network_the_wheel_waits_for_no_more_than_the_last_slice(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    page.page.evaluate(SLOW_NETWORK)
    before, step = float(page["slice-Red"].input_value()), float(page["slice-Red"].get_attribute("step"))
    page.turn_wheel("Red", [(0, 100)] * 8)
    shown = "document.querySelector('[data-testid=slice-Red]').value"
    page.page.wait_for_function(f"Math.abs({shown} - {before - 8 * step}) < {step / 2}")
    assert page.page.evaluate("usesOfViews") < 5
    page.turn_wheel("Red", [(0, -100)])
    page.page.wait_for_function(f"Math.abs({shown} - {before - 7 * step}) < {step / 2}")


def test_a_name_that_another_structure_has_is_not_taken_and_the_page_shows_the_old_one(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    for number in range(2):
        add_structure(page, number)
    page["class-name-1"].dblclick()
    page["class-name-1"].fill("Structure 1")
    page["class-name-1"].press("Enter")
    page.wait_for_state("message.includes('There is a structure called')")
    page.page.wait_for_function("document.querySelector('[data-testid=class-name-1]').value === 'Structure 2'")


def test_a_download_that_fails_leaves_no_file_and_the_page_as_it_is_with_the_reason(at_app: AppPage, volume: Path) -> None:
    page = at_app
    downloads: list[object] = []
    open_volume(page, volume)
    page.page.on("download", lambda download: downloads.append(download))
    add_structure(page, 0)
    page["pictures"].locator("summary").click()
    page.page.evaluate("trame.state.set('picture_width', 5)")
    page["picture"].click()
    page.wait_for_state("message.includes('expected whole numbers of pixels from 16 to 8192')")
    page.keep_picture("no picture")
    page.page.evaluate("trame.state.set('picture_width', 64)")
    with page.page.expect_download() as download:
        page["picture"].click()
    assert (download.value.suggested_filename, download.value.failure()) == (f"{volume.stem}.png", None)
    assert len(downloads) == 1
    page.wait_for_state("classes.length === 1")


def test_points_are_downloaded_and_dropped_on_the_scan_without_a_question(
    at_app: AppPage, volume: Path, tmp_path: Path
) -> None:
    page = at_app
    open_volume(page, volume)
    add_structure(page, 0)
    click_at(page, page.extent_in("Red"), 18, 24)
    page.wait_for_state("classes[0].positive === 1")
    page.keep_picture("points to download")
    with page.page.expect_download() as download:
        page["download-points"].click()
    assert download.value.suggested_filename == f"{volume.stem}.annotations.json"
    download.value.save_as(tmp_path / download.value.suggested_filename)
    page["class-remove-0"].click()
    add_structure(page, 0)
    drop(page, tmp_path / download.value.suggested_filename)
    page.wait_for_state("classes.length === 2 && classes[1].positive === 1 && classes[1].name === 'Structure 1 (2)'")
    assert not page["dropped"].count()
    page.keep_picture("points dropped")
    page["open"].click()
    page["open-dialog"].wait_for()
    page.keep_picture("open dialog")
    page.page.keyboard.press("Escape")


def test_what_is_dragged_over_the_page_may_be_dropped_there_until_it_leaves_also_in_safari(at_app: AppPage) -> None:
    # Which does not say of a drag that leaves something where it goes.
    told = at_app.page.evaluate(
        """() => {
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File(["scan"], "scan.nrrd"));
          const [panel, views] = [".panel", ".views"].map((one) => document.querySelector(one));
          const over = [["dragenter", panel], ["dragover", panel]];
          const steps = [...over, ["dragenter", views], ["dragleave", panel], ["dragleave", views]];
          return steps.map(([name, where]) => {
            where.dispatchEvent(new DragEvent(name, { dataTransfer, bubbles: true, cancelable: true }));
            return window.trame.state.get("dragging");
          });
        }"""
    )
    assert told == [False, True, True, True, False]


def test_a_folder_that_cannot_be_read_is_told_of(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    page.page.evaluate(
        """() => {
          const locked = { createReader: () => ({ readEntries: (_, reject) => reject(new DOMException("not permitted")) }) };
          const drop = new DragEvent("drop", { cancelable: true });
          const dataTransfer = { types: ["Files"], items: [{ webkitGetAsEntry: () => locked }] };
          Object.defineProperty(drop, "dataTransfer", { value: dataTransfer });
          window.dispatchEvent(drop);
        }"""
    )
    page.page.get_by_text("What was dropped cannot be read by the browser").wait_for()


def test_a_folder_without_files_is_told_of(at_app: AppPage, volume: Path, tmp_path: Path) -> None:
    page = at_app
    open_volume(page, volume)
    drop(page, tmp_path)
    page.page.get_by_text("What was dropped has no files in it").wait_for()
    (tmp_path / "notes.txt").write_text("notes", encoding="utf-8")
    drop(page, tmp_path / "notes.txt")
    page.page.get_by_text("'notes.txt' is of no known format").wait_for()
    assert "has no files" not in page["message"].inner_text()


def test_the_session_outlives_a_reload_and_names_are_text(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    extent = page.extent_in("Red")
    if page["extract"].is_visible():
        extract(page)
    add_structure(page, 0)
    before = page.picture("Red")
    clicked = click_at(page, extent, 18, 24)
    page.wait_for_state("classes[0].positive === 1 && up_to_date && !busy")
    hostile = "{{ constructor.constructor('window.owned = true')() }}<img src=x onerror='window.owned = true'>"
    page.rename(0, hostile)
    page.page.reload()
    page.wait_for_state("classes.length === 1 && classes[0].positive === 1")
    assert page["class-name-0"].input_value() == hostile
    assert page["volume-name"].inner_text() == volume.stem
    page.wait_for_picture("Red", lambda picture: change_near(before, picture, *clicked) > 15)
    page.keep_picture("after a reload")
    assert page.page.evaluate("window.owned") is None


def test_a_film_is_in_sight_again_after_a_reload(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    page["pictures"].locator("summary").click()
    page["picture-width"].fill("64")
    page["picture-height"].fill("64")
    page["film"].click()
    page["film-progress"].or_(page["film-download"]).wait_for()
    page.page.reload()
    page["film-download"].wait_for()


def test_a_small_structure_is_looked_at_closer_and_in_the_whole_again_by_keys(at_app: AppPage, folder: Path) -> None:
    import SimpleITK as sitk  # noqa: N813

    page = at_app
    voxels = np.random.default_rng(0).normal(0.0, 8.0, (40, 48, 56))
    voxels[14:26, 18:30, 12:24] += 200
    image = sitk.GetImageFromArray(voxels.astype(np.int16))
    image.SetSpacing([4.0] * 3)
    sitk.WriteImage(image, str(folder / "small.nrrd"))
    open_volume(page, folder / "small.nrrd")
    extract(page)
    extent = page.extent_in("Red")
    add_structure(page, 0)
    click_at(page, extent, 18, 24)
    page.wait_for_state("classes[0].positive === 1 && up_to_date && !busy")
    page["look-closer"].focus()
    page.page.keyboard.press("Enter")
    page["close-up-text"].wait_for()
    assert re.fullmatch(r"In a box of \d+ × \d+ × \d+ mm", page["close-up-text"].inner_text())
    page.keep_picture("a closer look")
    assert page.page.evaluate("(box => box.scrollWidth - box.clientWidth)(document.querySelector('.sections'))") <= 0
    page.page.keyboard.press("z")
    page["close-up-text"].wait_for(state="detached")
    page.wait_for_state("up_to_date && !busy")
    assert page["look-at-whole"].is_disabled()
    page.page.keyboard.press("c")
    page["close-up-text"].wait_for()
    page["look-at-whole"].focus()
    page.page.keyboard.press("Space")
    page["close-up-text"].wait_for(state="detached")


def test_a_closer_look_is_suggested_below_its_button_without_a_message(at_app: AppPage, volume: Path) -> None:
    page, hint = at_app, "Large corrections so far."
    open_volume(page, volume)
    add_structure(page, 0)
    assert page["close-up-hint"].count() == 0
    before = page["look-closer"].bounding_box()
    show = "hint => trame.state.set('settings', { ...trame.state.get('settings'), close_up_hint: hint })"
    page.page.evaluate(show, hint)
    page["close-up-hint"].wait_for()
    assert page["close-up-hint"].inner_text() == hint
    assert "suggested" in page["look-closer"].get_attribute("class")
    assert page["look-closer"].bounding_box() == before
    assert page["message"].count() == 0
    # In a close-up that began unasked, there is nothing to press.
    page.page.evaluate("trame.state.set('settings', { ...trame.state.get('settings'), can_look_at_whole: true })")
    page["look-at-whole"].and_(page.page.locator(":enabled")).wait_for()
    assert "suggested" not in page["look-closer"].get_attribute("class")
    page.page.evaluate(show, "")
    page["close-up-hint"].wait_for(state="detached")


def test_what_is_typed_stays_while_the_page_changes(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    add_structure(page, 0)
    page["class-name-0"].dblclick()
    for field, text in (("class-name-0", "half a na"), ("window-low", "-12"), ("window-high", "34")):
        page[field].press("ControlOrMeta+a")
        page[field].press_sequentially(text)
        page["theme"].evaluate("button => button.click()")
        page.wait_for_drawing()
        assert page[field].input_value() == text


def test_what_is_typed_takes_the_place_of_a_number_that_is_written_otherwise_meanwhile(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    page["window-low"].press("ControlOrMeta+a")
    # As the answer to the other end does, late.
    page.page.evaluate("trame.state.set('window', { ...trame.state.get('window'), low: -20.5 })")
    page.wait_for_drawing()
    page["window-low"].press_sequentially("-12")
    assert page["window-low"].input_value() == "-12"


@pytest.mark.parametrize(("end", "other_end"), [("low", "high"), ("high", "low")])
def test_what_is_typed_takes_the_place_of_an_intensity_in_3d_that_is_written_otherwise_meanwhile(
    at_app: AppPage, volume: Path, end: str, other_end: str
) -> None:
    page = at_app
    open_volume(page, volume)
    sliders = "tone: 0.5, fade: 0.5, edges: 0.5, inside: true, axis: { min: 0, max: 200, step: 1 }"
    show = f"look => trame.state.set('look', {{ automatic: false, {sliders}, ...look }})"
    page.page.evaluate("trame.state.set('appearance_open', true)")
    page.page.evaluate(show, {end: 50, other_end: 100})
    page[f"look-{end}"].press("ControlOrMeta+a")
    page.page.evaluate(show, {end: 50.25, other_end: 120})
    page.wait_for_drawing()
    page[f"look-{end}"].press_sequentially("12")
    assert page[f"look-{end}"].input_value() == "12"
    page.page.evaluate("trame.state.set('appearance_open', false)")


def test_what_follows_the_mouse_in_a_slice_goes_when_it_leaves(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    before = page.wait_for_picture("Red", lambda picture: picture.max() > 200)
    add_structure(page, 0)
    box = page["view-Red"].bounding_box()
    page.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    # The next point, and where it would be.
    page.wait_for_picture("Red", lambda picture: changed_share(before, picture) > 0.0)
    told = "document.querySelector(\"[data-testid='probe-Red']\").textContent"
    page.page.wait_for_function(f"/^[RL] \\d+, [AP] \\d+, [SI] \\d+: -?\\d+$/.test({told})")
    assert page["probe-Red"].is_visible()
    page.keep_picture("under the mouse")
    page.page.mouse.move(5, 5)
    page.wait_for_picture("Red", lambda picture: changed_share(before, picture) == 0.0)
    assert not page["probe-Red"].is_visible()


def test_a_number_that_is_deleted_is_none_and_leaves_what_was(at_app: AppPage, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    page["advanced"].evaluate("details => { details.open = true; }")
    page["network-automatic"].uncheck()
    page["network-low"].wait_for()
    windows = "['window', 'network_window'].map((name) => window.trame.state.get(name))"
    before = page.page.evaluate(windows)
    for field in ("window-low", "window-high", "network-low"):
        text = page[field].input_value()
        page[field].fill("")
        page[field].press("Tab")
        page.wait_for_drawing()
        assert page[field].input_value() == text
    # Answered after all that the page told before.
    add_structure(page, 0)
    assert page.page.evaluate(windows) == before


def test_a_second_browser_is_told_and_the_first_goes_on(at_app: AppPage, new_page: NewPage, server: Server) -> None:
    other = new_page()
    assert other.page.goto(server.address).status == 409
    other.keep_picture("second browser")
    assert "open in another browser" in other.page.inner_text("body")
    at_app.page.reload()
    at_app["app"].wait_for()


def test_an_app_that_nobody_uses_leaves_the_processor_alone(at_app: AppPage, server: Server, volume: Path) -> None:
    page = at_app
    open_volume(page, volume)
    add_structure(page, 0)
    end = time.monotonic() + LONGEST_WAIT_S
    used_s = 1.0
    # The last pictures may still be drawn. Half a per cent is usual; on a slow computer it is more.
    while used_s > 0.1 * REST_S:
        assert time.monotonic() < end, f"{used_s} s of the processor's time in {REST_S} s"
        before_s = server.processor_s()
        page.page.wait_for_timeout(1000 * REST_S)
        used_s = server.processor_s() - before_s


def test_an_extraction_is_cancelled_and_an_interruption_of_another_leaves_no_process(
    new_page: NewPage, folder: Path, options: list[str]
) -> None:
    with serving(folder / "two balls.nrrd", *options, "--grid", "48", cache=folder) as server:
        page = new_page()
        page.page.goto(server.address)
        page["extract"].click()
        page["extract-cancel"].click()
        page.wait_for_state("phase === 'no features'")
        page.keep_picture("cancelled")
        page["extract"].click()
        page.wait_for_state("progress && progress.share > 0")
        processes = server.processes()
        assert len(processes) > 1, "features are not computed in a process of their own"
        assert server.interrupt() == 0
        assert not still_running(processes)
        assert "Traceback" not in server.log()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals")
@pytest.mark.parametrize("name", ENDING)
def test_an_upload_that_stands_still_does_not_hold_up_the_end_and_leaves_nothing(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with serving(cache=folder) as server:
        address = urlsplit(server.address)
        browser = http.client.HTTPConnection(address.netloc)
        browser.request("GET", address.path)
        response = browser.getresponse()
        response.read()
        browser.putrequest("POST", f"{address.path}upload")
        browser.putheader("Origin", f"http://{address.netloc}")
        browser.putheader("Cookie", response.headers["Set-Cookie"].partition(";")[0])
        browser.putheader("Content-Type", "multipart/form-data; boundary=edge")
        browser.putheader("Content-Length", "1000000")
        browser.endheaders(b'--edge\r\nContent-Disposition: form-data; name="files"; filename="scan.raw"\r\n\r\nvoxels')
        while not list(tmp_path.rglob("scan.raw")):
            time.sleep(0.01)
        server.process.send_signal(getattr(signal, name))
        # Web servers wait a minute for their browsers.
        assert server.process.wait(45.0) == 0
        assert "Traceback" not in server.log()
    assert not list(tmp_path.iterdir())


def test_closing_the_tab_leaves_no_process(new_page: NewPage, folder: Path, options: list[str]) -> None:
    with serving(*options, "--grid", "8", cache=folder, seconds_to_return=0.5) as server:
        page = new_page()
        page.page.goto(server.address)
        page["app"].wait_for()
        processes = server.processes()
        page.page.close()
        assert not still_running(processes)
        assert server.process.wait() == 0
        assert "Traceback" not in server.log()
