"""Saving and downloading: what takes long does not stop the page, which shows how far it is."""

from __future__ import annotations

import asyncio
import errno
import io
import random
import tempfile
import threading
import zipfile
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

import pytest

pytest.importorskip("trame_slicer")
import aiohttp
import numpy as np
from aiohttp import web

from ViTTransferFunction.Logic.core.system.file_names import kept_name
from ViTTransferFunction.Logic.core.system.private_folder import PREFIX
from ViTTransferFunction.Logic.core.system.progress import WorkProgress
from ViTTransferFunction.Logic.scene.segments.scene_segments import SceneSegments
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.attack.scans import make_scan, write_dicom
from ViTTransferFunction.Testing.files.test_several_series import write_two
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.WebApp import routes
from ViTTransferFunction.WebApp.app import WebApp
from ViTTransferFunction.WebApp.scene_files import stage_session

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]


@asynccontextmanager
async def browser_of(app: WebApp) -> AsyncIterator[aiohttp.ClientSession]:
    """A browser before a server of the app's routes."""
    server = web.Application()
    routes.Routes(app, lambda name: f"/{name}").add(SimpleNamespace(app=server))
    runner = web.AppRunner(server)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    try:
        async with aiohttp.ClientSession(f"http://127.0.0.1:{runner.addresses[0][1]}") as browser:
            yield browser
    finally:
        await runner.cleanup()


class HeldPacking:
    """Packs when it is let go on, and is half through until then."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.let_go = threading.Event()
        self._pack = routes.zip_folder
        monkeypatch.setattr(routes, "zip_folder", self)

    def __call__(self, staged: Path, path: Path, progress: Any) -> None:
        progress(1, 2, "Compressing")
        assert self.let_go.wait(LONGEST_WAIT_S), "the server stood still meanwhile"
        self._pack(staged, path, progress)


async def status_and_body(browser: aiohttp.ClientSession, path: str) -> tuple[int, bytes]:
    async with browser.get(path) as response:
        return response.status, await response.read()


async def until(condition: Callable[[], bool]) -> None:
    async def wait() -> None:
        while not condition():
            await asyncio.sleep(0.01)

    await asyncio.wait_for(wait(), LONGEST_WAIT_S)


def test_while_a_session_is_packed_the_server_answers_and_the_page_shows_how_far_it_is(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    packing = HeldPacking(monkeypatch)

    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            saved = asyncio.create_task(status_and_body(browser, "/download/session"))
            await until(lambda: app.server.state.saving == {"name": "spheres.mrb", "percent": 50})
            assert (await status_and_body(browser, "/download/segmentation"))[0] == 404
            packing.let_go.set()
            status, body = await saved
        assert status == 200
        assert "spheres/spheres.mrml" in zipfile.ZipFile(io.BytesIO(body)).namelist()
        assert app.server.state.saving is None

    opened(journey)


@pytest.mark.parametrize("changes", [False, True])
def test_what_changes_while_it_is_saved_is_not_taken_for_saved(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, changes: bool
) -> None:
    packing = HeldPacking(monkeypatch)

    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        assert app.server.state.unsaved
        async with browser_of(app) as browser:
            saved = asyncio.create_task(status_and_body(browser, "/download/session"))
            await until(lambda: bool(app.server.state.saving and app.server.state.saving["percent"]))
            if changes:
                app.actions("addClass")
            packing.let_go.set()
            await saved
        assert app.server.state.unsaved == changes

    opened(journey)


def test_segments_that_were_written_after_the_save_are_unsaved_until_they_are_saved_too(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        async with browser_of(app) as browser:
            await status_and_body(browser, "/download/session")
            assert not app.server.state.unsaved
            monkeypatch.setattr(SceneSegments, "source", "another")
            app.refresh()
            assert app.server.state.unsaved
            await status_and_body(browser, "/download/session")
            assert not app.server.state.unsaved

    opened(journey)


def test_in_slicer_the_slice_views_of_a_saved_session_have_their_letters(
    opened: Callable[[Journey], None], tmp_path: Path
) -> None:
    """Slicer takes the letters of its views from the scene."""

    async def journey(app: WebApp) -> None:
        stage_session(app.scene, tmp_path / "session")

    opened(journey)
    (scene_file,) = (tmp_path / "session").glob("*.mrml")
    views = ElementTree.parse(scene_file).iter("Slice")
    assert {view.get("name"): view.get("layoutLabel") for view in views} == {"Red": "R", "Green": "G", "Yellow": "Y"}


def test_a_full_disk_is_told_and_nothing_is_taken_for_saved(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def pack(staged: Path, path: Path, progress: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(routes, "zip_folder", pack)

    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/session"))[0] == 204
        assert "No space left on device. Make room" in app.server.state.message
        assert app.server.state.unsaved
        assert app.server.state.saving is None

    opened(journey)


def test_where_all_structures_are_removed_again_nothing_is_unsaved(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        app.mark_saved(app.work)
        assert not app.server.state.unsaved
        app.actions("addClass")
        app.refresh()
        assert app.server.state.unsaved
        for state in app.session.classes:
            app.session.annotations.remove_class(state.id)
        app.refresh()
        assert not app.server.state.unsaved

    opened(journey)


def test_an_app_that_is_ended_packs_no_further(opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(WebApp, "stopping", True)

    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/session"))[0] == 503

    opened(journey)


def have_up_to_date_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if there were segments of all structures; nothing is written."""
    monkeypatch.setattr(SceneSegments, "write", lambda self, corrections: None)
    monkeypatch.setattr(SceneSegments, "exist", True)
    monkeypatch.setattr(SceneSegments, "source", "any")
    monkeypatch.setattr(SceneSegments, "outdated", False)


@pytest.mark.parametrize("succeeds", [False, True])
def test_a_download_waits_for_the_segments_and_is_given_up_where_they_are_not_written(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, succeeds: bool
) -> None:
    writing = WorkProgress(0, 0, "Segmenting", None)

    async def journey(app: WebApp) -> None:
        have_up_to_date_segments(monkeypatch)
        monkeypatch.setattr(SceneSession, "progress", writing)
        app.actions("updateAndDownload")
        app.refresh()
        assert not app.server.state.download_due
        monkeypatch.setattr(SceneSession, "progress", None)
        for written in (succeeds, False):  # They are told of once, and the page may be slow.
            monkeypatch.setattr(SceneSegments, "take_written", lambda self, written=written: written)
            app.refresh()
            assert app.server.state.download_due == succeeds
        app.server.state.download_due = False  # As the page does.
        monkeypatch.setattr(SceneSegments, "take_written", lambda self: True)
        app.refresh()
        assert not app.server.state.download_due

    opened(journey)


def test_a_download_waits_for_the_answer_where_segments_were_corrected_by_hand(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        have_up_to_date_segments(monkeypatch)
        monkeypatch.setattr(SceneSession, "progress", None)
        monkeypatch.setattr(SceneSegments, "take_corrected", lambda self: ("liver",))
        app.actions("updateAndDownload")
        app.refresh()
        assert app.server.state.corrected == ["liver"]
        monkeypatch.setattr(SceneSegments, "take_corrected", lambda self: ())
        app.refresh()
        monkeypatch.setattr(SceneSegments, "take_written", lambda self: True)
        app.actions("write", "keep")
        app.refresh()
        assert app.server.state.download_due
        app.server.state.download_due = False  # As the page does.

    opened(journey)


@pytest.mark.parametrize("answer", ["2: T1 axial (MR, 7×6×3)", ""])
def test_several_series_that_were_sent_are_kept_until_one_of_them_is_chosen(
    opened: Callable[[Journey], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    write_two(tmp_path / "disk")
    form = aiohttp.FormData()
    for path in (tmp_path / "disk").iterdir():
        form.add_field("files", path.read_bytes(), filename=path.name)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))

    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            sending = asyncio.create_task(browser.post("/upload", data=form))
            await until(lambda: app.server.state.series_offered)
            assert any((tmp_path / "temporary").glob(f"{PREFIX}*"))
            app.actions("series", answer)
            assert (await sending).status == 200
        assert not any((tmp_path / "temporary").glob(f"{PREFIX}*"))
        assert app.server.state.volume_name == ("DICOM series" if answer else "spheres")

    opened(journey)


@pytest.mark.parametrize(
    ("copies", "content", "why"),
    [
        (1, b"NRRD0004\n", "scan.nrrd"),
        (1, b"no image", "scan.nrrd cannot be read as an image: it is no NRRD file"),
        (2, None, "The DICOM series in DICOM series has two slices at one place: 000-2.dcm and 000.dcm"),
    ],
    ids=["cut off", "another kind", "slices twice"],
)
def test_what_is_wrong_with_files_that_were_sent_is_told_without_names_of_this_computer(
    in_app: Callable[[Journey], None], tmp_path: Path, copies: int, content: bytes | None, why: str
) -> None:
    form = aiohttp.FormData()
    slices = write_dicom(tmp_path / "sent", make_scan(random.Random(0), ("int16",))) if content is None else ()
    for name, sent in [("scan.nrrd", content)] if content is not None else [(path.name, path.read_bytes()) for path in slices]:
        for copy in range(copies):
            form.add_field("files", sent[:-1] + bytes([sent[-1] ^ copy]), filename=name)

    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser, browser.post("/upload", data=form) as response:
            assert response.status in (200, 400)
        assert app.server.state.message.startswith(why)
        assert "vittf-" not in app.server.state.message

    in_app(journey)


@pytest.mark.parametrize("stem", ["Müller Löwe 肝", "CT 3.2", "aux", "50%2f #1 & 'x' $HOME"])
def test_files_are_downloaded_under_the_name_of_the_scan_that_was_sent(
    opened: Callable[[Journey], None], file: Path, stem: str
) -> None:
    form = aiohttp.FormData(quote_fields=False)  # As browsers send names.
    form.add_field("files", file.read_bytes(), filename=f"{stem}.nrrd")
    kept, session = kept_name(stem), file.with_name("tomorrow.mrb")

    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            async with browser.post("/upload", data=form) as response:
                assert response.status == 200
            assert app.server.state.volume_name == kept
            id_ = app.session.annotations.add_class("liver").id
            app.session.annotations.add_points(id_, np.array([[-10.0, -20.0, 12.0]]), positive=True)
            app.session.set_segmentation(app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode"))
            endings = {"session": ".mrb", "segmentation": ".seg.nrrd", "points": ".annotations.json", "picture": ".png"}
            for kind, ending in endings.items():
                async with browser.get(f"/download/{kind}?width=64&height=48") as response:
                    assert response.status == 200, await response.text()
                    disposition = response.headers["Content-Disposition"]
                    assert disposition.endswith(f"filename*=UTF-8''{quote(kept + ending)}")
                    assert disposition.isascii()
                    if kind == "session":
                        session.write_bytes(await response.read())
        await app.opening.open([session])
        assert (app.server.state.message, app.server.state.volume_name) == ("", kept)

    opened(journey)


@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("", "DICOM series"),
        ("?folder=Müller%20CT%202", "Müller CT 2"),
        ("?folder=..%2F..", ".._"),
        ("?folder=CT%20o.B.", "CT o.B"),
    ],
)
def test_a_series_that_was_sent_and_what_is_saved_of_it_have_a_name_for_people(
    in_app: Callable[[Journey], None], tmp_path: Path, folder: str, name: str
) -> None:
    form = aiohttp.FormData()
    for path in write_dicom(tmp_path / "sent", make_scan(random.Random(0), ("int16",))):
        form.add_field("files", path.read_bytes(), filename=path.name)

    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            async with browser.post(f"/upload{folder}", data=form) as response:
                assert response.status == 200, await response.text()
            async with browser.get("/download/session") as response:
                assert f"''{quote(name)}.mrb" in response.headers["Content-Disposition"]
        assert app.server.state.volume_name == name

    in_app(journey)
