"""Points that were not saved when the app ended: kept on its computer, and offered when their scan is opened again."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

pytest.importorskip("trame_slicer")
pytest.importorskip("psutil")

from ViTTransferFunction.Logic.core.system.private_folder import PREFIX
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files import unsaved_files
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import array_from_node
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.unsaved_points import kept_in
from ViTTransferFunction.Testing.support.web_app import Server, serving
from ViTTransferFunction.Testing.web_app.test_points_file import points, send
from ViTTransferFunction.Testing.web_app.test_saving import browser_of, status_and_body, until
from ViTTransferFunction.WebApp import unsaved_points
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
AT_SPHERES = ((-10.0, -20.0, 12.0), (-24.0, -20.0, 16.0))
"""In the volume of spheres, as its file has it, RAS millimetres."""


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unsaved_points, "DELAY_S", 0.01)


@pytest.fixture
def folder(a_cache_of_its_own: Path) -> Path:
    """Where they are kept."""
    return a_cache_of_its_own / "unsaved"


def click(app: WebApp, name: str = "liver", place: int = 0) -> None:
    """Place a point of a structure, which is new unless there is one of this name."""
    id_ = next((state.id for state in app.session.classes if state.name == name), None)
    id_ = id_ or app.session.annotations.add_class(name).id
    app.session.annotations.add_points(id_, np.array([AT_SPHERES[place]]), positive=True)
    app.refresh()


async def is_kept(app: WebApp, folder: Path, *counts: int) -> None:
    """Wait until a file has structures of so many points."""

    def has_them() -> bool:
        geometry = app.session.file_classes.geometry
        return any(
            [len(each.request.positive) for each in read_annotations(path, geometry)] == [*counts] for path in kept_in(folder)
        )

    await until(has_them)


async def open_again(app: WebApp, file: Path) -> None:
    """Open a scan or session, and wait until it is known whether something was left of it."""
    await app.opening.open([file])
    await until(lambda: not app._tasks)


def offered(app: WebApp) -> Any:
    """What the page offers to restore; None for nothing."""
    return app.server.state.restorable


def message(app: WebApp) -> str:
    """What the page tells."""
    app.refresh()
    return str(app.server.state.message)


def names(app: WebApp) -> list[str]:
    return [state.name for state in app.session.classes]


def test_points_are_kept_for_their_user_alone_with_the_scans_path_and_offered_when_it_is_opened_again(
    opened: Callable[[Journey], None], file: Path, folder: Path
) -> None:
    async def journey(app: WebApp) -> None:
        click(app)
        click(app, "spleen", 1)
        await is_kept(app, folder, 1, 1)
        await app.unsaved_points._done(lambda: None)
        (path,) = kept_in(folder)
        content = json.loads(path.read_text(encoding="utf-8"))
        assert (content["scan"], content["model"]) == (str(file), app.session.parameters.get("usedModel"))
        if sys.platform != "win32":
            assert [each.stat().st_mode & 0o777 for each in (folder, *folder.iterdir())] == [0o700, 0o600, 0o600]
        # Where it lies now, or what it is called, does not matter.
        click(app, place=1)
        await open_again(app, file.rename(file.with_name("elsewhere.nrrd")))
        assert not app.session.classes
        assert (offered(app)["points"], offered(app)["names"]) == (3, ["liver", "spleen"])
        assert app.actions("restorePoints")
        assert [(state.name, state.positive) for state in app.session.classes] == [
            ("liver", AT_SPHERES), ("spleen", (AT_SPHERES[1],)),
        ]  # fmt: skip
        assert app.server.state.unsaved
        await until(lambda: not app._tasks)
        assert offered(app) is None
        # Until they are saved, they are kept as before.
        await is_kept(app, folder, 2, 1)
        (renewed,) = kept_in(folder)
        assert renewed != path
        app.actions("undo")
        assert not app.session.classes

    opened(journey)


def test_names_in_arabic_and_hebrew_are_offered_side_by_side_without_changing_places(
    opened: Callable[[Journey], None], file: Path, folder: Path
) -> None:
    async def journey(app: WebApp) -> None:
        for name in ("كبد 2", "כבד (2)", "liver"):
            click(app, name)
        await is_kept(app, folder, 1, 1, 1)
        await open_again(app, file)
        assert offered(app)["names"] == ["\u2068كبد 2\u2069", "\u2068כבד (2)\u2069", "liver"]
        assert app.actions("restorePoints")
        assert names(app) == ["كبد 2", "כבד (2)", "liver"]

    opened(journey)


def test_what_is_discarded_is_gone_and_another_scan_is_offered_nothing(
    opened: Callable[[Journey], None], file: Path, folder: Path, spheres: Spheres
) -> None:
    other = file.with_name("other.nrrd")
    image = sitk.GetImageFromArray(spheres[0].array)
    image.SetOrigin((0.0, 0.0, 1.0))
    sitk.WriteImage(image, str(other))

    async def journey(app: WebApp) -> None:
        click(app)
        # Of the same voxels, but elsewhere in the patient.
        await open_again(app, other)
        assert offered(app) is None
        await open_again(app, file)
        assert offered(app)["points"] == 1
        app.actions("discardPoints")
        await until(lambda: not app._tasks)
        assert offered(app) is None
        assert not any(folder.iterdir())
        assert not app.session.classes

    opened(journey)


def test_an_offer_that_is_passed_over_is_made_again_and_is_not_lost_by_new_points(
    opened: Callable[[Journey], None], file: Path, folder: Path
) -> None:
    async def journey(app: WebApp) -> None:
        click(app)
        await is_kept(app, folder, 1)
        os.utime(kept_in(folder)[0], (1e9, 1e9))
        await open_again(app, file)
        click(app, "spleen", 1)
        await open_again(app, file)
        assert offered(app)["names"] == ["spleen"]
        app.actions("restorePoints")
        await until(lambda: not app._tasks)
        assert (offered(app)["names"], offered(app)["when_ms"]) == (["liver"], 1e12)
        app.actions("restorePoints")
        assert names(app) == ["spleen", "liver"]

    opened(journey)


@pytest.mark.parametrize("saved_by", ["/download/session", "/download/points", "opening points", "undo"])
def test_what_is_saved_elsewhere_or_taken_back_is_not_kept(
    opened: Callable[[Journey], None], file: Path, folder: Path, saved_by: str
) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            if saved_by == "opening points":
                await send(browser, scan=points())
            else:
                click(app)
                await is_kept(app, folder, 1)
            if saved_by == "undo":
                app.actions("undo")
            elif saved_by != "opening points":
                assert (await status_and_body(browser, saved_by))[0] == 200
        before = app.session.classes
        await open_again(app, file)
        assert offered(app) is None
        assert not any(folder.glob("*"))
        # What comes after it is, though points are opened beside it.
        click(app, "later")
        if saved_by == "opening points":
            async with browser_of(app) as browser:
                await send(browser, scan=points())
            assert len(app.session.classes) == len(before) + 1
        await open_again(app, file)
        assert "later" in offered(app)["names"]

    opened(journey)


def test_a_session_that_was_changed_after_it_was_saved_becomes_what_it_was_changed_to(
    opened: Callable[[Journey], None], file: Path, tmp_path: Path
) -> None:
    session = tmp_path / "session.mrb"

    async def journey(app: WebApp) -> None:
        for name in ("liver", "spleen", "gone"):
            click(app, name)
        ids = {state.name: state.id for state in app.session.classes}
        app.actions("set", "tone", 0.25)
        async with browser_of(app) as browser:
            session.write_bytes((await status_and_body(browser, "/download/session"))[1])
        await open_again(app, session)
        assert offered(app) is None
        click(app, "liver", 1)
        app.actions("rename", ids["spleen"], "milt")
        app.actions("remove", ids["gone"])
        await open_again(app, session)
        assert names(app) == ["liver", "spleen", "gone"]
        app.actions("restorePoints")
        assert names(app) == ["liver", "milt"]
        liver = app.session.classes[0]
        assert (liver.id, len(liver.positive), liver.look.tone) == (ids["liver"], 2, 0.25)
        app.actions("undo")
        assert names(app) == ["liver", "spleen", "gone"]

    opened(journey)


def test_a_structure_that_was_clicked_since_stays_beside_the_restored_one(
    opened: Callable[[Journey], None], file: Path
) -> None:
    async def journey(app: WebApp) -> None:
        click(app, place=0)
        await open_again(app, file)
        click(app, place=1)
        app.actions("restorePoints")
        assert [(state.name, state.positive) for state in app.session.classes] == [
            ("liver", (AT_SPHERES[1],)), ("liver (2)", (AT_SPHERES[0],)),
        ]  # fmt: skip

    opened(journey)


@pytest.mark.parametrize("damage", [b"", b"\x00\xff" * 50, b'{"coordinate_system": "RAS", "classes": [{"name": "liv', b"[1]"])
def test_a_file_that_is_damaged_is_passed_over_and_the_user_is_told_which(
    opened: Callable[[Journey], None], file: Path, folder: Path, damage: bytes
) -> None:
    async def journey(app: WebApp) -> None:
        click(app)
        await is_kept(app, folder, 1)
        (sound,) = kept_in(folder)
        damaged = sound.with_name(f"{sound.name.split('-')[0]}-0.annotations.json")
        damaged.write_bytes(damage)
        await open_again(app, file)
        assert offered(app)["names"] == ["liver"]
        assert "cannot be used" in message(app)
        assert str(damaged) in message(app)
        assert str(sound) not in message(app)
        assert damaged.read_bytes() == damage

    opened(journey)


def test_what_another_app_is_still_working_on_is_not_offered(
    opened: Callable[[Journey], None], file: Path, folder: Path
) -> None:
    async def journey(app: WebApp) -> None:
        click(app)
        other = unsaved_files.UnsavedFile(array_from_node(app.session.parameters.volume), app.session.file_classes.geometry)
        other.write(app.session.file_classes.annotated(), "elsewhere", "")
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/points"))[0] == 200
        await open_again(app, file)
        assert offered(app) is None
        other.close()
        await open_again(app, file)
        assert offered(app)["points"] == 1

    opened(journey)


@pytest.fixture
def an_unsaved_file() -> unsaved_files.UnsavedFile:
    return unsaved_files.UnsavedFile(np.arange(8).reshape(2, 2, 2), Geometry((2, 2, 2), np.eye(4)))


@pytest.mark.skipif(os.name == "nt", reason="Windows removes no open file")
@pytest.mark.parametrize("removes", [False, True])
def test_what_is_written_to_is_known_as_that_though_another_app_looks_as_it_begins(
    an_unsaved_file: unsaved_files.UnsavedFile, folder: Path, monkeypatch: pytest.MonkeyPatch, removes: bool
) -> None:
    take, looks = unsaved_files.take_lock, [True]

    def take_after_another(descriptor: int) -> bool | None:
        if not looks:
            return take(descriptor)
        looks.clear()
        (lock,) = folder.glob("*.lock")
        with lock.open() as others:
            take(others.fileno())
            if removes:
                lock.unlink()
            else:
                return take(descriptor)
        return take(descriptor)

    monkeypatch.setattr(unsaved_files, "take_lock", take_after_another)
    an_unsaved_file.write([], "", "")
    (path,) = kept_in(folder)
    assert unsaved_files._is_written_to(path)
    an_unsaved_file.close()
    assert not unsaved_files._is_written_to(path)


@pytest.mark.skipif(os.name == "nt", reason="Windows removes no open file")
def test_nobody_takes_a_lock_while_it_is_removed(
    an_unsaved_file: unsaved_files.UnsavedFile, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.mkdir()
    lock = folder / "left.lock"
    lock.touch()
    unlink, taken = Path.unlink, []

    def unlink_while_another_tries(path: Path, missing_ok: bool = False) -> None:
        if path == lock:
            with path.open() as others:
                taken.append(unsaved_files.take_lock(others.fileno()))
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", unlink_while_another_tries)
    an_unsaved_file.write([], "", "")
    assert (taken, lock.exists()) == ([False], False)
    an_unsaved_file.close()


def test_beyond_some_files_and_bytes_the_oldest_go(
    opened: Callable[[Journey], None], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unsaved_files, "MOST_FILES", 3)

    async def journey(app: WebApp) -> None:
        click(app)
        await is_kept(app, folder, 1)
        ours = kept_in(folder)
        classes = app.session.file_classes.annotated()
        others: list[Path] = []
        for number in range(5):
            another = unsaved_files.UnsavedFile(np.arange(8).reshape(2, 2, 2) + number, Geometry((2, 2, 2), np.eye(4)))
            another.write(classes, "", "")
            another.close()
            (path,) = set(kept_in(folder)) - {*ours, *others}
            os.utime(path, (1e9 + number,) * 2)
            others.append(path)
        click(app)
        await is_kept(app, folder, 2)
        await until(lambda: len(kept_in(folder)) == 3)
        assert {*kept_in(folder)} == {*ours, *others[-2:]}
        monkeypatch.setattr(unsaved_files, "MOST_BYTES", ours[0].stat().st_size)
        click(app)
        # With its lock.
        await until(lambda: kept_in(folder) == ours and len(list(folder.iterdir())) == 2)

    opened(journey)


def test_structures_of_one_name_cannot_be_kept_and_what_was_kept_before_stays(
    opened: Callable[[Journey], None], folder: Path
) -> None:
    async def journey(app: WebApp) -> None:
        click(app)
        click(app, "spleen", 1)
        await is_kept(app, folder, 1, 1)
        # As in a session that was edited in Slicer.
        app.session.annotations.points_node(app.session.classes[1].id, positive=True).SetName("liver")
        await until(lambda: "are not kept on this computer" in message(app))
        await app.unsaved_points._done(lambda: None)
        await is_kept(app, folder, 1, 1)

    opened(journey)


def test_where_they_cannot_be_kept_the_user_is_told_once_until_they_can(
    opened: Callable[[Journey], None], folder: Path
) -> None:
    async def journey(app: WebApp) -> None:
        folder.write_text("in the way")
        click(app)
        await until(lambda: "are not kept on this computer" in message(app))
        app.close_messages()
        click(app)
        await until(lambda: app.unsaved_points._timer is None)
        await app.unsaved_points._done(lambda: None)
        assert message(app) == ""
        folder.unlink()
        click(app)
        await is_kept(app, folder, 3)

    opened(journey)


@pytest.mark.slow
def test_an_app_that_was_killed_offers_the_points_in_the_browser_when_it_is_started_again(
    new_page: Callable[[], Any], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan, temporary = tmp_path / "noise.nrrd", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    sitk.WriteImage(sitk.GetImageFromArray(np.random.default_rng(1).normal(0.0, 8.0, (20, 22, 24))), str(scan))

    def opened_in(server: Server) -> Any:
        page = new_page()
        page.page.goto(server.address)
        page.wait_for_state("volume_name === 'noise' && opening === ''")
        return page

    with serving(scan, "--device", "cpu", cache=tmp_path) as server:
        page = opened_in(server)
        page["add-class"].click()
        page.wait_for_state("classes.length === 1")
        page.click_in("Red", 150, 150)
        page.click_in("Red", 170, 150)
        page.wait_for_state("classes[0].positive === 2")
        page.rename(0, "nodule")

        def has_both() -> bool:
            classes = [each for path in kept_in(folder) for each in json.loads(path.read_text())["classes"]]
            return [(each["name"], len(each["positive"])) for each in classes] == [("nodule", 2)]

        end = time.monotonic() + LONGEST_WAIT_S
        while not has_both():
            assert time.monotonic() < end, "what was clicked was not kept"
            time.sleep(0.05)
        server.process.kill()
    # Private folders go when they are next looked for.
    assert not [left.name for left in temporary.iterdir() if not left.name.startswith(PREFIX)]
    with serving(scan, "--device", "cpu", cache=tmp_path) as server:
        page = opened_in(server)
        page["restorable"].wait_for()
        page.keep_picture("offered")
        assert "2 points" in page["restorable"].inner_text()
        assert "nodule" in page["restorable"].inner_text()
        assert page.page.evaluate("trame.state.get('classes').length") == 0
        page["restore"].click()
        page.wait_for_state("classes.length === 1 && classes[0].name === 'nodule' && classes[0].positive === 2")
        page["restorable"].wait_for(state="detached")
        page.keep_picture("restored")
