"""The page's transfer function editor: what it shows of a structure in 3D, and what its handles and sliders do."""

from __future__ import annotations

import base64
from collections.abc import Callable, Coroutine
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.rendering.composition import DEPTH, INTENSITY, NUMBER
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState
from ViTTransferFunction.Logic.scene.views.session_views import SessionViews
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]

OWN = (0.0, 200.0)
"""Intensities of the structure."""


@pytest.fixture
def in_3d(opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch) -> Callable[[Journey], None]:
    """Runs a journey on an app with a structure that is in 3D; the part of the page that shows how it looks is closed."""

    def run(journey: Journey) -> None:
        async def go(app: WebApp) -> None:
            app.actions("addClass")
            (structure,) = app.session.classes
            monkeypatch.setattr(app.session._proxy, "rendering", rendering())
            monkeypatch.setattr(app.session._proxy, "rendered", (structure.id,))
            try:
                await journey(app)
            finally:
                app.actions("appearance", False)

        opened(go)

    return run


def rendering() -> StructureVolume:
    """A structure whose intensities are evenly `OWN`, in the middle of brighter ones."""
    voxels = np.zeros((20, 20, 20, 4), np.uint8)
    voxels[..., INTENSITY] = 220
    voxels[5:15, 5:15, 5:15, INTENSITY] = np.linspace(50, 150, 1000).reshape(10, 10, 10)
    voxels[5:15, 5:15, 5:15, [NUMBER, DEPTH]] = 1, 255
    levels = np.linspace(-100.0, 410.0, 256)
    return StructureVolume(voxels, np.array([[50.0, 150.0]]), levels, True, 1.0, Geometry((20, 20, 20), np.eye(4)))


def test_intensities_in_3d_are_the_structures_own_until_they_are_set(in_3d: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        state = app.server.state
        app.actions("appearance", True)
        assert (state.look["low"], state.look["high"], state.look["automatic"]) == (*OWN, True)
        app.actions("look", 60.0, None, False)
        assert [(one.look.low, one.look.high) for one in app.session.classes] == [(60.0, 200.0)]
        assert (state.look["low"], state.look["automatic"]) == (60.0, False)
        app.actions("look", None, 150.0, False)
        assert [(one.look.low, one.look.high) for one in app.session.classes] == [(60.0, 150.0)]
        app.actions("look", None, None, True)
        assert [(one.look.low, one.look.high) for one in app.session.classes] == [(None, None)]

    in_3d(journey)


def test_the_handles_lie_on_the_axis_of_the_histogram(in_3d: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("appearance", True)
        look, (structure,) = app.server.state.look, app.session.classes
        histogram = app.session.views.histogram(structure)
        assert histogram is not None
        axis = look["axis"]
        assert (axis["min"], axis["max"]) == histogram.ends
        assert axis["min"] < look["low"] < look["high"] < axis["max"]
        # Fine enough that no pixel is left out, and not so fine that arrow keys get nowhere.
        assert 500 <= (axis["max"] - axis["min"]) / axis["step"] <= 2000

    in_3d(journey)


def test_the_histogram_is_a_picture_that_follows_the_window(in_3d: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("appearance", True)
        before = app.server.state.histogram
        kind, _, content = before.partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert ElementTree.fromstring(base64.b64decode(content)).tag == "{http://www.w3.org/2000/svg}svg"
        app.actions("look", 60.0, None, False)
        assert app.server.state.histogram != before

    in_3d(journey)


def test_intensities_are_counted_only_while_somebody_sees_them(
    in_3d: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    counted: list[str] = []
    histogram = SessionViews.histogram

    def count(self: SessionViews, state: ClassState) -> Any:
        counted.append(state.id)
        return histogram(self, state)

    monkeypatch.setattr(SessionViews, "histogram", count)

    async def journey(app: WebApp) -> None:
        app.refresh()
        assert not counted
        app.actions("appearance", True)
        assert counted
        app.actions("appearance", False)
        counted.clear()
        app.refresh()
        assert not counted
        assert (app.server.state.look, app.server.state.histogram) == (None, "")

    in_3d(journey)


def test_sliders_are_those_of_the_style_until_they_are_moved_and_again_after_another_style(
    in_3d: Callable[[Journey], None],
) -> None:
    async def journey(app: WebApp) -> None:
        def shares() -> tuple[float, ...]:
            return tuple(app.server.state.look[name] for name in ("tone", "fade", "edges"))

        app.actions("appearance", True)
        app.actions("style", "vessels")
        assert shares() == pytest.approx((0.55, 1.0, 0.0))
        app.actions("set", "tone", 0.4)
        app.actions("fade", 0.3)
        app.actions("set", "edges", 0.2)
        assert shares() == pytest.approx((0.4, 0.3, 0.2))
        look = app.session.classes[0].look
        assert (look.tone, look.ramp, look.edges) == pytest.approx((0.4, 0.7, 0.2))
        app.actions("style", "as scanned")
        assert shares() == pytest.approx((0.85, 0.85, 0.0))

    in_3d(journey)


def test_only_styles_that_show_the_inside_have_edges(in_3d: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("appearance", True)
        assert not app.server.state.look["inside"]
        app.actions("style", "vessels")
        assert app.server.state.look["inside"]

    in_3d(journey)


@pytest.mark.parametrize(("sent", "taken"), [(7.0, 1.0), (-7.0, 0.0)])
def test_what_is_out_of_a_slider_s_range_is_taken_for_its_end(
    in_3d: Callable[[Journey], None], sent: float, taken: float
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("fade", sent)
        app.actions("set", "opacity", sent)
        look = app.session.classes[0].look
        assert (look.ramp, look.opacity) == (1.0 - taken, taken)

    in_3d(journey)


def test_without_a_structure_in_3d_there_is_nothing_to_edit(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("appearance", True)
        assert app.server.state.look is None
        app.actions("addClass")
        assert app.server.state.look is None
        app.actions("appearance", False)

    opened(journey)
