"""The page's button that computes features: nothing is downloaded for them before the user agreed."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
from ViTTransferFunction.Testing.support.downloads import DOWNLOAD
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[FeatureEstimate | None]:
    """The estimates that extractions were begun with; none goes on."""
    begun: list[FeatureEstimate | None] = []
    monkeypatch.setattr(SceneSession, "phase", "no features")
    monkeypatch.setattr(SceneSession, "start_extraction", lambda self: begun.append(self.estimate))
    return begun


@pytest.fixture
def being_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    """What features cost is not known yet."""
    monkeypatch.setattr(SceneSession, "estimate", None)
    monkeypatch.setattr(SceneSession, "busy", True)


def test_weights_are_downloaded_when_the_user_agreed_and_not_before(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, begun: list[FeatureEstimate | None]
) -> None:
    estimate = FeatureEstimate(False, 60.0, 10**9, DOWNLOAD)
    monkeypatch.setattr(SceneSession, "estimate", estimate)

    async def journey(app: WebApp) -> None:
        state = app.server.state
        app.actions("extract")
        assert DOWNLOAD.licence in state.consent
        assert state.pressed
        app.actions("consent", False)
        assert (state.consent, state.pressed, begun) == ("", False, [])
        app.actions("extract")
        assert state.consent
        app.actions("consent", True)
        assert (state.consent, state.pressed, begun) == ("", False, [estimate])
        # As after it was cancelled.
        app.actions("extract")
        assert (state.consent, begun) == ("", [estimate] * 2)

    opened(journey)


def test_the_extraction_begins_as_soon_as_it_is_known_that_nothing_has_to_be_downloaded(
    opened: Callable[[Journey], None],
    monkeypatch: pytest.MonkeyPatch,
    begun: list[FeatureEstimate | None],
    being_estimated: None,
) -> None:
    async def journey(app: WebApp) -> None:
        state = app.server.state
        app.actions("extract")
        assert (state.consent, state.pressed, begun) == ("", True, [])
        monkeypatch.setattr(SceneSession, "estimate", FeatureEstimate(False, 60.0, 10**9))
        app.refresh()
        assert (state.consent, state.pressed, len(begun)) == ("", False, 1)

    opened(journey)


def test_where_the_cost_cannot_be_told_the_button_is_let_go(
    opened: Callable[[Journey], None],
    monkeypatch: pytest.MonkeyPatch,
    begun: list[FeatureEstimate | None],
    being_estimated: None,
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("extract")
        monkeypatch.setattr(SceneSession, "busy", False)
        app.refresh()
        assert (app.server.state.pressed, begun) == (False, [])
        # It is tried again, since what was in the way may be gone.
        tried: list[None] = []
        monkeypatch.setattr(SceneSession, "estimate_again", lambda self: tried.append(None))
        app.actions("extract")
        assert len(tried) == 1

    opened(journey)
