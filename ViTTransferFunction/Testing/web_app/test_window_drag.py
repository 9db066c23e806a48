"""Dragging in a slice changes the window in which all slices show the volume, where the left button means nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Logic.scene.volumes.volume_nodes import array_from_node
from ViTTransferFunction.Testing.support.web_app import NETWORK_S, SLOW_NETWORK, AppPage
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
NO_KEYS, CTRL, SHIFT = [False, False, False], [True, False, False], [False, True, False]
WIDTH, HEIGHT = 300, 200
"""Of the views, in pixels."""
START = (0.3, 0.2)


@pytest.fixture
def in_views(opened: Callable[[Journey], None]) -> Callable[[Journey], None]:
    """Runs a journey on an app without structures, with views of a size."""

    def run(journey: Journey) -> None:
        async def go(app: WebApp) -> None:
            for view in app.views.slices:
                view.render_window().SetSize(WIDTH, HEIGHT)
                view.reset_view()
            await journey(app)

        opened(go)

    return run


def window(app: WebApp) -> tuple[float, float]:
    """Width and middle of the window."""
    display = app.session.parameters.volume.GetScalarVolumeDisplayNode()
    return display.GetWindow(), display.GetLevel()


def drag(app: WebApp, *places: tuple[float, float], keys: list[bool] = NO_KEYS) -> None:
    """Drag in the axial view with the left button, over places in shares of it."""
    first, *others = ([list(place), keys] for place in places)
    last = others[-1] if others else first
    moves = [["move", *place] for place in others]
    app.views.use("Red", [["hover", *first], ["press", *first, "left"], *moves, ["release", *last, "left"]])


def test_to_the_right_is_wider_and_upwards_brighter_by_shares_of_the_volumes_range(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        voxels = array_from_node(app.session.parameters.volume)
        span = float(voxels.max() - voxels.min())
        width, middle = window(app)
        drag(app, START, (0.5, 0.9), (START[0] + 20 / WIDTH, START[1] - 10 / HEIGHT))
        np.testing.assert_allclose(window(app), (width + 20 / HEIGHT * span, middle + 10 / HEIGHT * span))
        assert not app.session.classes

    in_views(journey)


def test_the_pages_numbers_follow_and_no_preset_is_on_any_more(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        def on(state: Any) -> list[bool]:
            return [(each["low"], each["high"]) == (state.window["low"], state.window["high"]) for each in state.windows]

        app.refresh()
        assert any(on(app.server.state))
        drag(app, START, (0.5, 0.2))
        width, middle = window(app)
        shown = app.server.state.window
        np.testing.assert_allclose((shown["low"], shown["high"]), (middle - width / 2, middle + width / 2), atol=width / 1000)
        assert not any(on(app.server.state))

    in_views(journey)


def test_no_drag_leaves_the_window_without_width_or_beside_the_volume(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        voxels = array_from_node(app.session.parameters.volume)
        for _ in range(20):
            drag(app, (1.0, 0.0), (0.0, 1.0))
        width, middle = window(app)
        assert width > 0.0
        assert middle + width / 2 == pytest.approx(voxels.min())

    in_views(journey)


def test_a_volume_with_infinite_voxels_is_dragged_by_its_other_ones(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        volume = app.session.parameters.volume
        array_from_node(volume)[0, 0, 0] = np.inf
        volume.GetImageData().GetPointData().GetScalars().Modified()
        before, _ = window(app)
        drag(app, START, (0.5, 0.2))
        width, middle = window(app)
        assert np.isfinite(middle)
        assert before < width < np.inf

    in_views(journey)


def test_a_release_that_the_page_lost_ends_the_drag_once_another_page_is_loaded(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.views.use("Red", [["press", list(START), NO_KEYS, "left"]])
        app._expect_page()
        before = window(app)
        app.views.use("Red", [["hover", [0.9, 0.9], NO_KEYS]])
        assert window(app) == before

    in_views(journey)


def test_with_shift_the_slice_is_moved_as_before(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        before, to_ras = window(app), app.views.slices[0].get_view_node().GetXYToRAS()
        corner = to_ras.MultiplyPoint((0.0, 0.0, 0.0, 1.0))
        drag(app, START, (0.5, 0.2), keys=SHIFT)
        assert not np.allclose(to_ras.MultiplyPoint((0.0, 0.0, 0.0, 1.0)), corner)
        assert window(app) == before

    in_views(journey)


@pytest.mark.parametrize("tool", ["pointOn", "brushOn", "lassoOn", "boxOn", "diameter"])
def test_a_tool_in_hand_has_the_left_button(in_views: Callable[[Journey], None], tool: str) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        if app.tool.tool != tool:
            app.actions(tool)
        before = window(app)
        drag(app, (0.4, 0.4), (0.6, 0.4), (0.6, 0.6))
        assert app.session.classes[0].positive
        assert window(app) == before

    in_views(journey)


def test_with_ctrl_a_tool_in_hand_does_nothing_and_the_window_changes(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        for tool in ("pointOn", "brushOn", "lassoOn", "diameter", "eraser"):
            if app.tool.tool != tool:
                app.actions(tool)
            before = window(app)
            drag(app, START, (0.5, 0.2), keys=CTRL)
            assert window(app)[0] > before[0]
            assert app.tool.tool == tool
        assert not app.session.classes[0].positive

    in_views(journey)


def test_a_point_under_the_mouse_is_dragged_also_without_a_tool(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        drag(app, (0.5, 0.5))
        app.actions("putDown")
        (placed,) = app.session.classes[0].positive
        before = window(app)
        app.views.use("Red", [["hover", [0.1, 0.1], NO_KEYS]])
        drag(app, (0.5, 0.5), (0.6, 0.5))
        (moved,) = app.session.classes[0].positive
        assert moved != placed
        assert window(app) == before

    in_views(journey)


def contrast(picture: np.ndarray) -> float:
    """How much a view's middle, which the volume fills, differs within itself."""
    rows, columns = (slice(size // 4, 3 * size // 4) for size in picture.shape[:2])
    return float(picture[rows, columns].std())


def is_paler(picture: np.ndarray, than: float) -> bool:
    """Whether there is clearly less contrast in a view than there was."""
    return contrast(picture) < 0.8 * than


@pytest.mark.slow
def test_in_a_browser_a_drag_changes_all_slices_and_the_numbers_also_over_a_slow_network(at_noise: AppPage) -> None:
    page = at_noise
    views = ("Red", "Green", "Yellow")
    before = {view: contrast(page.wait_for_picture(view, lambda picture: contrast(picture) > 20)) for view in views}
    assert page["window-0"].evaluate("button => button.classList.contains('on')")
    low, high = (float(page[f"window-{end}"].input_value()) for end in ("low", "high"))
    page.page.evaluate(SLOW_NETWORK)
    begun_s = time.monotonic()

    box = page["view-Red"].bounding_box()
    x, y = box["x"] + 100, box["y"] + 100
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    for by in range(1, 201):
        page.page.mouse.move(x + by, y)
    # While the button is still held.
    for view in views:
        page.wait_for_picture(view, partial(is_paler, than=before[view]))
    page.keep_picture("window dragged")
    page.page.mouse.up()
    page.page.wait_for_function(f"window.trame.state.get('window').high > {high} + 0.3 * ({high} - {low})")
    # Two hundred moves go together while others are answered: a few at a time, or more where the browser gets little time, of
    # which each then takes so long that it is answered before the next.
    assert page.page.evaluate("usesOfViews") <= 100 + (time.monotonic() - begun_s) / NETWORK_S
    assert float(page["window-high"].input_value()) > high
    assert float(page["window-low"].input_value()) < low
    assert not page["window-0"].evaluate("button => button.classList.contains('on')")
    page["window-0"].click()
    page.page.wait_for_function(f"window.trame.state.get('window').high === {high}")

    # With a tool in hand, by the key that Macs have for it.
    page["add-class"].click()
    page.page.wait_for_function("window.trame.state.get('tool') === 'pointOn'")
    page.page.keyboard.down("Meta")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x + 80, y)
    page.page.mouse.up()
    page.page.keyboard.up("Meta")
    page.page.wait_for_function(f"window.trame.state.get('window').high > {high}")
    page.wait_for_state("classes.length === 1 && classes[0].positive === 0")
    page.keep_picture("window dragged with a tool in hand")
