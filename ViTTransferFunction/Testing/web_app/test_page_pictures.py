"""Pictures and films of the 3D view that the page offers for download."""

from __future__ import annotations

import asyncio
import io
import json
import threading
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

import vtk
from PIL import Image

from ViTTransferFunction.Logic.scene.views.filming import Filming
from ViTTransferFunction.Testing.files.test_film import frames_of
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.web_app.test_saving import browser_of, status_and_body, until
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]


@pytest.fixture
def with_ball(opened: Callable[[Journey], None]) -> Callable[[Journey], None]:
    """Runs a journey on an app with a ball in the middle of its 3D view, on blue."""

    def run(journey: Journey) -> None:
        async def go(app: WebApp) -> None:
            actor, mapper, ball = vtk.vtkActor(), vtk.vtkPolyDataMapper(), vtk.vtkSphereSource()
            mapper.SetInputConnection(ball.GetOutputPort())
            actor.SetMapper(mapper)
            renderer = app.views.view_3d.renderer()
            renderer.AddActor(actor)
            renderer.SetBackground(0.0, 0.0, 1.0)
            renderer.ResetCamera(-0.5, 0.5, -0.5, 0.5, -0.5, 0.5)
            try:
                await journey(app)
            finally:
                app.films.give_up()
                renderer.RemoveActor(actor)

        opened(go)

    return run


def test_a_picture_is_of_the_size_that_was_asked_for_with_or_without_background(
    with_ball: Callable[[Journey], None],
) -> None:
    async def journey(app: WebApp) -> None:
        window = app.views.view_3d.render_window()
        before = window.GetSize()
        async with browser_of(app) as browser:
            asked = "/download/picture?width=64&height=48&transparent="
            answers = [await status_and_body(browser, asked + transparent) for transparent in ("false", "true")]
        assert [status for status, _ in answers] == [200, 200]
        opaque, transparent = (np.asarray(Image.open(io.BytesIO(body))) for _, body in answers)
        assert (opaque.shape, transparent.shape) == ((48, 64, 3), (48, 64, 4))
        assert opaque[0, 0].tolist() == [0, 0, 255]
        assert (transparent[0, 0, 3], transparent[24, 32, 3]) == (0, 255)
        assert window.GetSize() == before

    with_ball(journey)


@pytest.mark.parametrize("side", ["15", "8193", "", "-64", "64.5", "1e3", "9" * 40, "<b>"])
def test_a_picture_of_no_possible_size_is_refused_in_words(with_ball: Callable[[Journey], None], side: str) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser, browser.get("/download/picture", params={"width": side, "height": 48}) as answer:
            assert answer.status == 204
        assert "expected whole numbers of pixels from 16 to 8192" in app.server.state.message
        app.close_messages()

    with_ball(journey)


def test_why_there_was_no_picture_is_told_once_and_until_there_is_one(with_ball: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/picture?width=99999&height=48"))[0] == 204
            app.actions("film", 99999, 48, 8, ".gif")
            assert app.server.state.message.count("The size of a picture has 99999") == 1
            app.actions("film", 99, 48, "", ".gif")
            assert (await status_and_body(browser, "/download/picture?width=99999&height=48"))[0] == 204
            assert "The size of a picture has 99999" in app.server.state.message
            assert (await status_and_body(browser, "/download/picture?width=64&height=48"))[0] == 200
        assert "The size of a picture" not in app.server.state.message
        app.close_messages()

    with_ball(journey)


def test_a_camera_is_relative_to_the_structures_and_found_again(
    with_ball: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    middle_ras = np.array([12.0, 14.0, 16.0])

    async def journey(app: WebApp) -> None:
        camera, state = app.views.view_3d.renderer().GetActiveCamera(), app.server.state
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/camera?width=64&height=48"))[0] == 204
            assert "Place a point on a structure, and switch the 3D views on." in state.message
            monkeypatch.setattr(app.session.views, "middle_ras", lambda: middle_ras)
            camera.SetPosition(12.0, 114.0, 16.0)
            camera.SetFocalPoint(*middle_ras)
            camera.SetViewUp(0.0, 0.0, 1.0)
            status, body = await status_and_body(browser, "/download/camera?width=64&height=48")
        assert status == 200
        assert json.loads(body)["position_mm"] == [0.0, 100.0, 0.0]
        camera.SetPosition(500.0, 0.0, 0.0)
        app.actions("loadCamera", body.decode())
        assert camera.GetPosition() == pytest.approx((12.0, 114.0, 16.0))
        assert (state.picture_width, state.picture_height) == (64, 48)

    with_ball(journey)


@pytest.mark.parametrize("text", ["", "{", "[1]", "[" * 100_000, '{"position_mm": [1e999, 0, 0], "focal_point_mm": "x"}'])
def test_a_file_that_is_no_camera_is_refused_without_names_of_this_computer(
    with_ball: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    async def journey(app: WebApp) -> None:
        monkeypatch.setattr(app.session.views, "middle_ras", lambda: np.zeros(3))
        before = app.views.view_3d.renderer().GetActiveCamera().GetPosition()
        app.actions("loadCamera", text)
        assert "The file" in app.server.state.message
        assert "vittf-" not in app.server.state.message
        assert app.views.view_3d.renderer().GetActiveCamera().GetPosition() == before
        app.close_messages()

    with_ball(journey)


def test_a_film_is_shot_while_the_server_answers_and_is_fetched_when_it_is_ready(with_ball: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        state = app.server.state
        async with browser_of(app) as browser:
            assert (await status_and_body(browser, "/download/film"))[0] == 404
            app.actions("film", 64, 48, 1, ".gif")
            await until(lambda: state.film is None or state.film["share"] > 0.2)
            assert state.film["text"].startswith("Filming")
            assert (await status_and_body(browser, "/download/picture?width=32&height=32"))[0] == 200
            assert state.film is not None, "the server stood still while the film was shot"
            await until(lambda: state.film_ready)
            assert state.film is None
            status, body = await status_and_body(browser, "/download/film")
        assert status == 200
        path = Path(app.films.path or "")
        assert path.read_bytes() == body
        frames, seconds = frames_of(path)
        assert (len(frames), seconds, frames[0].shape) == (12, 1.0, (48, 64, 3))
        app.films.give_up()
        assert not path.parent.exists()
        assert not state.film_ready

    with_ball(journey)


@pytest.mark.parametrize("end", ["cancelFilm", "another volume"])
def test_a_film_that_is_given_up_leaves_nothing(with_ball: Callable[[Journey], None], tmp_path: Path, end: str) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("film", 64, 48, 8, ".gif")
        await until(lambda: app.server.state.film["share"] > 0.0)
        folder = Path(app.films._folder.name) if app.films._folder else Path()
        assert any(folder.iterdir())
        if end == "cancelFilm":
            app.actions(end)
        else:
            await app.opening.open([tmp_path / "spheres.nrrd"])
        await until(lambda: not folder.exists())
        assert (app.server.state.film, app.server.state.film_ready) == (None, False)
        assert app.server.state.message == ""

    with_ball(journey)


def test_the_server_does_not_wait_for_what_a_cancelled_film_still_writes(
    with_ball: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    let_go = threading.Event()
    cancel = Filming.cancel

    def wait(self: Filming) -> None:
        assert let_go.wait(LONGEST_WAIT_S), "the server stood still meanwhile"
        cancel(self)

    monkeypatch.setattr(Filming, "cancel", wait)

    async def journey(app: WebApp) -> None:
        app.actions("film", 64, 48, 8, ".gif")
        await until(lambda: app.server.state.film["share"] > 0.0)
        folder = Path(app.films._folder.name) if app.films._folder else Path()
        app.actions("cancelFilm")
        assert app.server.state.film is None
        assert folder.exists()
        let_go.set()
        await until(lambda: not folder.exists())

    with_ball(journey)


def test_the_answer_to_a_click_comes_before_the_next_frame(
    with_ball: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = 0
    advance = Filming.advance

    def count(self: Filming) -> bool:
        nonlocal shot
        shot += 1
        return advance(self)

    async def journey(app: WebApp) -> None:
        monkeypatch.setattr(Filming, "advance", count)
        with monkeypatch.context() as patch:
            patch.setattr(type(app.session), "awaits_maps", True)
            app.actions("film", 64, 48, 1, ".gif")
            await asyncio.sleep(0.2)
            assert shot == 0
        await until(lambda: app.server.state.film_ready)
        assert shot > 12

    with_ball(journey)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ((9, 48, 8, ".gif"), "expected whole numbers of pixels"),
        ((64, 48, 8, ".avi"), "expected .mp4 or .gif"),
        ((64, 48, "", ".gif"), "A film of 0 seconds cannot be made; expected 1 to 60"),
        ((64, 48, 61, ".gif"), "A film of 61 seconds cannot be made; expected 1 to 60"),
        ((64, 48, 1e9, ".gif"), "seconds cannot be made; expected 1 to 60"),
        ((64, 48, 8, "/../../x.gif"), "expected .mp4 or .gif"),
    ],
)
def test_a_film_that_cannot_be_made_says_why(with_ball: Callable[[Journey], None], asked: tuple[Any, ...], said: str) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("film", *asked)
        assert said in app.server.state.message
        assert (app.server.state.film, app.films.path) == (None, None)
        app.close_messages()

    with_ball(journey)


def test_a_film_that_breaks_off_is_told_and_can_be_begun_again(
    with_ball: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Logic.core.system.errors import InputError

    def full(self: Filming) -> bool:
        raise InputError("the disk is full")

    async def journey(app: WebApp) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(Filming, "advance", full)
            app.actions("film", 64, 48, 1, ".gif")
            await until(lambda: app.server.state.film is None)
        assert "the disk is full" in app.server.state.message
        app.actions("film", 64, 48, 1, ".gif")
        await until(lambda: app.server.state.film_ready)

    with_ball(journey)
