"""A closer look on the page: what its buttons ask of the session, when they can be pressed, and the words below them."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.system.progress import WorkProgress
from ViTTransferFunction.Logic.scene.annotation.close_up_hints import CloseUpHints
from ViTTransferFunction.Logic.scene.annotation.close_ups import SceneCloseUps
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.WebApp.app import WebApp
from ViTTransferFunction.WebApp.panel_form import panel_form

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]

BOX = (-11.5, -9.5, 8.5, 24.0, 20.0, 18.0)
"""In the corner of the volume that is at 0."""
WORDS = "In a box of 24 × 20 × 18 mm"


@pytest.fixture
def ready(opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch) -> Callable[[Journey], None]:
    """Runs a journey on an app that takes its volume for one with features, and in which every structure is in the same box."""
    monkeypatch.setattr(SceneSession, "phase", "ready")
    monkeypatch.setattr(SceneCloseUps, "look_closer", lambda self, id_: self.look_at(id_, CloseUp(BOX[:3], BOX[3:])))
    return opened


def add_structure(app: WebApp, *, positive: bool) -> None:
    """Add a structure with a point inside or outside, and select it."""
    app.actions("addClass")
    app.session.annotations.add_points(app.session.classes[-1].id, np.zeros((1, 3)), positive=positive)
    app.refresh()


def shown(app: WebApp) -> tuple[bool, bool, str]:
    """Which of both buttons can be pressed, and the words."""
    settings = app.server.state.settings
    return settings["can_look_closer"], settings["can_look_at_whole"], settings["close_up"]


def test_the_selected_structure_is_looked_at_closer_and_in_the_whole_again(ready: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=True)
        add_structure(app, positive=True)
        assert shown(app) == (True, False, "")
        app.actions("lookCloser")
        assert [state.close_up for state in app.session.classes] == [None, BOX]
        assert shown(app) == (True, True, WORDS)
        app.actions("lookAtWhole")
        assert [state.close_up for state in app.session.classes] == [None, None]
        assert shown(app) == (True, False, "")

    ready(journey)


def test_the_words_follow_a_point_beyond_the_box(ready: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=True)
        app.actions("lookCloser")
        app.session.annotations.add_points(app.session.classes[0].id, np.array([[-40.0, 0.0, 0.0]]), positive=True)
        app.refresh()
        # To 3.6 mm beyond the middle of the point's voxel, and so to the end of a voxel.
        assert shown(app) == (True, True, "In a box of 45 × 20 × 18 mm")

    ready(journey)


def test_undo_and_redo_bring_the_buttons_along(ready: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=True)
        app.actions("lookCloser")
        app.actions("undo")
        assert shown(app) == (True, False, "")
        app.actions("redo")
        assert shown(app) == (True, True, WORDS)

    ready(journey)


def test_a_structure_without_a_point_inside_cannot_be_looked_at_closer(ready: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=False)
        assert shown(app) == (False, False, "")

    ready(journey)


def test_without_features_the_page_says_why_there_is_no_closer_look(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=True)
        assert shown(app) == (False, False, "")
        app.actions("lookCloser")
        assert "Place a point on Structure 1 first" in app.server.state.message
        assert shown(app) == (False, False, "")
        app.close_messages()

    opened(journey)


def test_the_page_tells_a_closer_look_from_the_writing_of_segments(
    ready: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        app.refresh()
        assert (app.server.state.progress, app.server.state.looks_closer) == (None, False)
        with monkeypatch.context() as patch:
            patch.setattr(app.session._proxy, "progress", WorkProgress(1, 4, "Looking closer at gland", None))
            patch.setattr(type(app.session._proxy), "looks_closer", True)
            app.refresh()
            assert app.server.state.progress == {"share": 0.25, "text": "Looking closer at gland…"}
            assert app.server.state.looks_closer

    ready(journey)


def test_the_page_suggests_a_closer_look_at_the_selected_structure(
    ready: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=True)
        add_structure(app, positive=True)
        first, second = app.session.classes
        assert app.server.state.settings["close_up_hint"] == ""
        words = {
            "vague extent": "In the whole scan, it is unclear how far this reaches. ",
            "small drawing": "What you drew is smaller than four cells",
        }
        for reason, beginning in words.items():
            reasons = {first.id: None, second.id: reason}
            monkeypatch.setattr(CloseUpHints, "of", lambda self, state, reasons=reasons: reasons[state.id])
            app.refresh()
            assert app.server.state.settings["close_up_hint"].startswith(beginning)
            assert '"Look closer" (C) may help' in app.server.state.settings["close_up_hint"]
        assert app.server.state.message == ""
        app.actions("select", first.id)
        assert app.server.state.settings["close_up_hint"] == ""

    ready(journey)


def test_the_page_says_that_a_closer_look_began_unasked(
    ready: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        add_structure(app, positive=True)
        monkeypatch.setattr(CloseUpHints, "of", lambda self, state: "small outline")
        app.actions("lookCloser")
        assert app.server.state.settings["close_up_hint"].startswith("Small, and in the whole scan unlike your outline")
        assert shown(app) == (True, True, WORDS)

    ready(journey)


def test_without_a_structure_nothing_happens(ready: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("lookCloser")
        app.actions("lookAtWhole")
        assert (app.server.state.settings, app.server.state.message) == (None, "")

    ready(journey)


def test_the_words_and_the_key_are_those_of_the_panel(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        form = panel_form()
        assert form["closeUpLayoutLabel"]["label"] == "Close-up"
        assert [form[f"{name}Button"]["text"] for name in ("lookCloser", "lookAtWhole")] == ["Look closer", "Look at whole"]
        (key,) = (key for key in app.server.state["keys"] if key["action"] == "lookCloser")
        assert key == {"key": "C", "action": "lookCloser", "meaning": "look closer at the structure", "while_held": False}

    opened(journey)
