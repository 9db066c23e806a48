"""Fingers on the views: what a tap, a stroke and two fingers that spread do."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Testing.support.web_app import AppPage
from ViTTransferFunction.WebApp.app import WebApp
from ViTTransferFunction.WebApp.view_steps import LARGEST_FACTOR

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
Finger = tuple[float, float]
NO_KEYS = [False, False, False]


@pytest.fixture
def in_views(opened: Callable[[Journey], None]) -> Callable[[Journey], None]:
    """Runs a journey on an app with a structure, the tool for its points in hand, and views of a size."""

    def run(journey: Journey) -> None:
        async def go(app: WebApp) -> None:
            for view in (*app.views.slices, app.views.view_3d):
                view.render_window().SetSize(300, 200)
            for view in app.views.slices:
                view.reset_view()
            app.actions("addClass")
            await journey(app)

        opened(go)

    return run


def test_a_tap_places_a_point_and_leaves_no_other_hanging_on_the_finger(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        node = app.views.slices[0].get_view_node()
        expected = node.GetXYToRAS().MultiplyPoint((0.4 * 300, 0.75 * 200, 0.0, 1.0))[:3]
        at = [[0.4, 0.25], NO_KEYS]
        app.views.use("Red", [["move", *at], ["press", *at, "left"], ["release", *at, "left"], ["leave", *at]])
        (structure,) = app.session.classes
        np.testing.assert_allclose(structure.positive, [expected], atol=0.5)
        points = app.session.annotations.points_node(structure.id, True)
        assert points.GetNumberOfControlPoints() == 1

    in_views(journey)


def test_what_lies_between_two_fingers_stays_there_while_they_spread(in_views: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        view = app.views.slices[0]
        node, offset = view.get_view_node(), view.get_slice_value()
        held = node.GetXYToRAS().MultiplyPoint((90.0, 100.0, 0.0, 1.0))
        width, height, _ = node.GetFieldOfView()
        app.views.use("Red", [["spread", [0.3, 0.5], NO_KEYS, [0.5, 0.6], 2.0]])
        np.testing.assert_allclose(node.GetFieldOfView()[:2], (width / 2, height / 2))
        np.testing.assert_allclose(node.GetXYToRAS().MultiplyPoint((150.0, 80.0, 0.0, 1.0)), held, atol=1e-6)
        assert view.get_slice_value() == pytest.approx(offset)
        view.reset_view()
        np.testing.assert_allclose(node.GetFieldOfView()[:2], (width, height))

    in_views(journey)


@pytest.mark.parametrize(("spread", "times"), [(2.0, 2.0), (0.5, 0.5), (1e9, LARGEST_FACTOR), (0.0, 1.0 / LARGEST_FACTOR)])
def test_two_fingers_bring_views_nearer_and_farther_at_each_step_by_no_more_than_hands_do(
    in_views: Callable[[Journey], None], spread: float, times: float
) -> None:
    async def journey(app: WebApp) -> None:
        camera, node = app.views.view_3d.get_camera_node().GetCamera(), app.views.slices[0].get_view_node()
        before = camera.GetDistance(), node.GetFieldOfView()[0]
        for view in ("ThreeD", "Red"):
            app.views.use(view, [["spread", [0.5, 0.5], NO_KEYS, [0.5, 0.5], spread]])
        assert (camera.GetDistance() * times, node.GetFieldOfView()[0] * times) == pytest.approx(before)

    in_views(journey)


@pytest.mark.slow
def test_in_a_browser_fingers_place_points_paint_enlarge_and_change_the_window(at_noise: AppPage) -> None:
    page = at_noise
    browser = page.page.context.new_cdp_session(page.page)
    box = page["view-Red"].bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def fingers(*events: tuple[str, tuple[Finger, ...]]) -> None:
        for name, places in events:
            points = [{"x": column, "y": row, "id": number} for number, (column, row) in enumerate(places)]
            browser.send("Input.dispatchTouchEvent", {"type": name, "touchPoints": points})

    # Without a tool, a finger changes the window, until it is lifted.
    high = float(page["window-high"].input_value())
    fingers(("touchStart", ((x, y),)), *(("touchMove", ((x + by, y),)) for by in (20, 40, 60)), ("touchEnd", ()))
    page.page.wait_for_function(f"window.trame.state.get('window').high > {high}")
    page["window-0"].click()
    page.page.wait_for_function(f"window.trame.state.get('window').high === {high}")

    page["add-class"].click()
    page["class-0"].wait_for()
    fingers(("touchStart", ((x, y),)), ("touchEnd", ()))
    page.wait_for_state("classes[0].positive === 1")

    # A second finger comes later than the first, which presses nothing by itself.
    before = page.picture("Red")
    fingers(("touchStart", ((x, y),)), ("touchStart", ((x, y), (x + 40, y))))
    fingers(*(("touchMove", ((x - by, y), (x + 40 + by, y))) for by in (10, 20, 30)), ("touchEnd", ()))
    page.wait_for_picture("Red", lambda picture: bool((picture != before).mean() > 0.3) and picture.max() > 50)

    page["tool-brushOn"].click()
    page.page.wait_for_function("window.trame.state.get('tool') === 'brushOn'")
    strokes = [("touchMove", ((x - 60 + by, y - 60),)) for by in range(10, 100, 10)]
    fingers(("touchStart", ((x - 60, y - 60),)), *strokes, ("touchEnd", ()))
    page.wait_for_state("classes[0].positive > 1")
    page.keep_picture("by fingers")


STEPS = """() => {
    window.stepsOfViews = [];
    const send = window.viewStep;
    window.viewStep = (...step) => { stepsOfViews.push(step); send(...step); };
}"""
"""Keeps what mouse and fingers do in the views."""


@pytest.mark.slow
def test_two_fingers_on_a_touchpad_enlarge_and_ctrl_with_the_wheel_stays_what_it_is(at_noise: AppPage) -> None:
    page = at_noise
    browser = page.page.context.new_cdp_session(page.page)
    box = page["view-Red"].bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.evaluate(STEPS)
    # As Chromium has them from a touchpad: with Ctrl, which nobody holds.
    for _ in range(4):
        turn = {"type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": -4, "modifiers": 2}
        browser.send("Input.dispatchMouseEvent", turn)
    page.page.wait_for_function("stepsOfViews.length > 0 && stepsOfViews.every((step) => step[1] === 'spread' && step[5] > 1)")
    page.page.mouse.move(x, y)
    for key in ("Control", "Meta"):
        page.page.keyboard.down(key)
        page.page.mouse.wheel(0, -100)
        page.page.keyboard.up(key)
        page.page.wait_for_function("stepsOfViews.at(-1)[1] === 'wheel'")
        _, _, _, keys, notches = page.page.evaluate("stepsOfViews.pop()")
        assert (keys, notches) == ([True, False, False], 1)


GESTURE = """(scales) => {
    const view = document.querySelector("[data-testid=view-Red]"), { x, y } = view.getBoundingClientRect();
    return scales.map((scale, index) => {
        const gesture = new Event(index ? "gesturechange" : "gesturestart", { bubbles: true, cancelable: true });
        Object.assign(gesture, { scale, clientX: x + 20, clientY: y + 20 });
        view.dispatchEvent(gesture);
        return gesture.defaultPrevented;
    });
}"""
"""Spreads two fingers on a touchpad as Safari tells of them; whether the page keeps each event from it."""


@pytest.mark.slow
def test_two_fingers_on_a_touchpad_enlarge_a_slice_and_not_the_page_in_safari(at_noise: AppPage) -> None:
    page = at_noise
    page["view-Red"].wait_for()
    page.page.wait_for_function("Boolean(window.viewStep)")
    page.page.evaluate(STEPS)
    for _ in range(2):
        assert page.page.evaluate(GESTURE, [1.0, 1.5, 3.0]) == [True, True, True]
    steps = page.page.evaluate("stepsOfViews")
    assert [(step[1], step[5]) for step in steps] == [("spread", 1.5), ("spread", 2.0)] * 2
