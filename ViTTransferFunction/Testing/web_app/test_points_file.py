"""Points as a file: downloaded from the app under the name that a cohort finds, and added to the scan that is open."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any
from urllib.parse import quote

import aiohttp
import numpy as np
import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.CommandLine.cohort.cases import read_cases
from ViTTransferFunction.Testing.web_app.test_saving import browser_of, status_and_body
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
IN_THE_MIDDLE = [[24.0, 20.0, 16.0]]
"""Of the spheres' voxels."""


def points(**fields: Any) -> bytes:
    entry = {"name": "liver", "positive": IN_THE_MIDDLE, "size": 0.5, "opacity": 0.25, **fields}
    return json.dumps({"coordinate_system": "IJK", "classes": [entry, {"name": "spleen", "positive": IN_THE_MIDDLE}]}).encode()


async def send(browser: aiohttp.ClientSession, **files: bytes) -> str:
    """Send files, by their names without endings; returns the reason why they are refused, or nothing."""
    form = aiohttp.FormData()
    for name, content in files.items():
        form.add_field("files", content, filename=f"{name}.annotations.json")
    async with browser.post("/upload", data=form) as answer:
        return str((await answer.json()).get("error", ""))


def test_points_are_downloaded_under_the_name_by_which_a_cohort_finds_them(
    opened: Callable[[Journey], None], file: Path
) -> None:
    scan = file.rename(file.with_name("CT 3.2 Müller.nrrd"))

    async def journey(app: WebApp) -> None:
        await app.opening.open([scan])
        assert not app.server.state.annotated
        id_ = app.session.annotations.add_class("liver").id
        app.session.annotations.add_points(id_, np.array([[-10.0, -20.0, 12.0]]), positive=True)
        app.refresh()
        assert app.server.state.annotated
        async with browser_of(app) as browser, browser.get("/download/points") as answer:
            assert answer.status == 200
            name = "CT 3.2 Müller.annotations.json"
            assert f"filename*=UTF-8''{quote(name)}" in answer.headers["Content-Disposition"]
            (scan.parent / name).write_bytes(await answer.read())

    opened(journey)
    (case,) = read_cases(scan.parent)
    assert (case.volume, json.loads(case.annotations.read_text())["classes"][0]["positive"]) == (scan, [[-10.0, -20.0, 12.0]])


def test_structures_that_no_file_can_tell_apart_are_not_downloaded_and_the_page_says_why(
    opened: Callable[[Journey], None],
) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/points"))[0] == 204
            assert "There are no classes; annotate at least one structure" in app.server.state.message
            for _ in range(2):
                await send(browser, scan=points())
            assert "are all there already" in app.server.state.message
            node = app.session.annotations.points_node(app.session.classes[1].id, positive=True)
            node.SetName("liver")  # Past the app, as in Slicer's module Data.
            assert (await status_and_body(browser, "/download/points"))[0] == 204
        assert "2 classes are named 'liver'; give each class a name of its own" in app.server.state.message

    opened(journey)


def test_a_file_of_points_adds_its_structures_to_the_scan_in_one_step_for_undo(
    opened: Callable[[Journey], None], file: Path
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        async with browser_of(app) as browser:
            assert await send(browser, scan=points()) == ""
        state = app.server.state
        assert [each["name"] for each in state.classes] == ["Structure 1", "liver", "spleen"]
        assert (state.message, state.volume_name, state.unsaved) == ("", "spheres", True)
        selected = app.session.selected_class
        assert selected is not None
        assert (selected.name, selected.size, selected.look.opacity) == ("liver", 0.5, 0.25)
        assert selected.positive[0] == pytest.approx(
            app.session.file_classes.geometry.ijk_to_ras_points(np.array(IN_THE_MIDDLE))[0]
        )
        app.actions("undo")
        assert [each["name"] for each in state.classes] == ["Structure 1"]
        path = file.with_name("annotations.json")
        path.write_bytes(points())
        await app.opening.open([path])
        assert len(state.classes) == 3

    opened(journey)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (points(positive=[[1000.0, 0.0, 0.0]]), "1 of 1 points of class 'liver' lie outside the volume"),
        (points(colour="red"), "scan.annotations.json: class 1 has an unknown field 'colour'"),
        (b"{", "scan.annotations.json is not valid JSON"),
        (b"[]", "scan.annotations.json is not an annotation file"),
    ],
)
def test_what_cannot_be_added_is_refused_without_names_of_this_computer(
    opened: Callable[[Journey], None], content: bytes, why: str
) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            await send(browser, scan=content)
        assert why in app.server.state.message
        assert "vittf-" not in app.server.state.message
        assert not app.session.classes

    opened(journey)


def test_another_file_takes_the_place_of_what_was_said_of_the_one_before(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            await send(browser, one=points(colour="red"))
            await send(browser, two=b"[]")
        assert app.server.state.message.startswith("two.annotations.json")
        assert "one.annotations.json" not in app.server.state.message

    opened(journey)


def test_points_are_refused_where_no_scan_is_open_or_one_is_just_being_opened(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            app.server.state.opening = "another.nrrd"
            await send(browser, scan=points())
            assert "A scan is just being opened. Open scan.annotations.json again" in app.server.state.message
            app.server.state.opening = ""
            app.session.set_volume(None)
            await send(browser, scan=points())
            assert "There is no scan that the points could belong to; open it first." in app.server.state.message
        assert not app.session.classes

    opened(journey)


def test_several_files_of_points_at_once_are_refused(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            assert "or points by themselves" in await send(browser, one=points(), two=points())
        assert not app.session.classes

    opened(journey)
