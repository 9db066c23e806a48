"""A line across a structure, and one around it, drawn in the browser: what is seen of them, and what becomes of them."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Testing.support.web_app import AppPage
from ViTTransferFunction.WebApp.app import WebApp

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]
NO_KEYS = [False, False, False]
SCROLL_BAR_PX = 11


def draw(app: WebApp, tool: str, way: list[list[float]]) -> None:
    """Draw in the axial view, through places in it; there are no points before the button is released."""
    app.views.slices[0].reset_view()
    app.actions("addClass")
    app.actions(tool)
    app.views.use("Red", [["move", way[0], NO_KEYS], ["press", way[0], NO_KEYS, "left"]])
    app.views.use("Red", [["move", place, NO_KEYS] for place in way[1:]])
    assert app.session.classes[0].positive == ()
    app.views.use("Red", [["release", way[-1], NO_KEYS, "left"], ["leave", way[-1], NO_KEYS]])


def test_a_line_drawn_in_the_app_gives_points_inside_and_outside_in_one_step(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        view = app.views.slices[0]
        view.render_window().SetSize(300, 200)
        draw(app, "diameter", [[0.4, 0.5], [0.5, 0.4], [0.6, 0.5]])
        to_ras = view.get_view_node().GetXYToRAS()
        ends = np.array([to_ras.MultiplyPoint((share * 300, 100.0, 0.0, 1.0))[:3] for share in (0.4, 0.6)])
        inside, outside = points_of_diameter(ends, app.session.body_scale)
        (structure,) = app.session.classes
        np.testing.assert_allclose(structure.positive, inside, atol=0.5)
        np.testing.assert_allclose(structure.negative, outside, atol=0.5)
        app.actions("undo")
        (structure,) = app.session.classes
        assert (structure.positive, structure.negative) == ((), ())

    opened(journey)


@pytest.mark.parametrize(("tool", "polarity"), [("brushOn", "positive"), ("brushOff", "negative")])
def test_the_brush_in_hand_is_as_large_as_the_slider_says(opened: Callable[[Journey], None], tool: str, polarity: str) -> None:
    async def journey(app: WebApp) -> None:
        before = app.server.state.brush_mm
        app.server.state.ready()  # Until a page is there, the app does not hear of changes.
        app.views.slices[0].render_window().SetSize(300, 200)
        app.views.slices[0].reset_view()
        app.actions("addClass")
        app.actions(tool)
        way = [[0.3 + 0.01 * step, 0.5] for step in range(40)]
        for size_mm in (3.0, 6.0):
            with app.server.state as state:
                state.brush_mm = size_mm
            app.views.use("Red", [["move", way[0], NO_KEYS], ["press", way[0], NO_KEYS, "left"]])
            app.views.use("Red", [["move", place, NO_KEYS] for place in way])
            app.views.use("Red", [["release", way[-1], NO_KEYS, "left"]])
            places = np.array(getattr(app.session.classes[0], polarity))
            assert np.linalg.norm(places[-1] - places[-2]) == pytest.approx(size_mm, rel=0.2)
        app.server.state.brush_mm = before

    opened(journey)


@pytest.mark.parametrize("tool", ["lassoOn", "boxOff", "diameter"])
def test_who_clicks_with_a_tool_that_draws_is_told_to_drag(opened: Callable[[Journey], None], tool: str) -> None:
    async def journey(app: WebApp) -> None:
        app.views.slices[0].render_window().SetSize(200, 200)
        draw(app, tool, [[0.5, 0.5]])
        app.refresh()
        assert "Hold the left button down, and drag" in app.server.state.message
        (structure,) = app.session.classes
        assert (structure.positive, structure.negative) == ((), ())

    opened(journey)


def test_an_outline_drawn_in_the_app_gives_points_inside_and_around_in_one_step(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        view = app.views.slices[0]
        view.render_window().SetSize(200, 200)
        corners = [[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]]
        draw(app, "outline", corners)
        to_ras = view.get_view_node().GetXYToRAS()
        outline = np.array([to_ras.MultiplyPoint((200 * x, 200 * (1 - y), 0.0, 1.0))[:3] for x, y in corners])
        inside, outside = points_of_outline(outline, app.session.body_scale)
        (structure,) = app.session.classes
        assert len(structure.positive) == len(inside)
        middle = outline.mean(axis=0)
        for found, expected in ((structure.positive, inside), (structure.negative, outside)):
            far = [np.linalg.norm(np.array(points) - middle, axis=1).max() for points in (found, expected)]
            assert far[0] == pytest.approx(far[1], abs=1.0)
        app.actions("undo")
        (structure,) = app.session.classes
        assert (structure.positive, structure.negative) == ((), ())

    opened(journey)


@pytest.mark.slow
def test_in_a_browser_a_line_is_seen_while_it_is_drawn_and_one_undo_takes_its_points_back(at_noise: AppPage) -> None:
    page = at_noise
    high = page["window-high"].input_value()
    begin_with_a_structure(page)
    page.page.keyboard.press("m")
    page.page.wait_for_function("window.trame.state.get('tool') === 'diameter'")
    assert page["tool-diameter"].get_attribute("aria-pressed") == "true"
    for width in (1024, 1280):
        page.page.set_viewport_size({"width": width, "height": 800})
        page.wait_for_drawing()
        assert tools_fit(page)
        page.keep_picture(f"tools at {width}")
    box = page["view-Red"].bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(x - 50, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y + 10)
    page.page.mouse.move(x + 50, y)
    # While the button is held.
    page.wait_for_picture("Red", lambda picture: is_blue(picture).sum() > 60)
    page.keep_picture("diameter drawn")
    page.page.mouse.up()
    page.wait_for_state("classes[0].positive > 0 && classes[0].negative > 0")
    page.wait_for_picture("Red", lambda picture: is_blue(picture).sum() < 60)
    page.keep_picture("points of a diameter")
    page["undo"].click()
    page.wait_for_state("classes[0].positive === 0 && classes[0].negative === 0")
    assert page["window-high"].input_value() == high

    # With a finger, which begins to draw as soon as it has moved.
    browser = page.page.context.new_cdp_session(page.page)
    for name, places in (
        ("touchStart", [x - 50]), ("touchMove", [x - 30]), ("touchMove", [x]), ("touchMove", [x + 50]), ("touchEnd", []),
    ):  # fmt: skip
        points = [{"x": column, "y": y, "id": 0} for column in places]
        browser.send("Input.dispatchTouchEvent", {"type": name, "touchPoints": points})
    page.wait_for_state("classes[0].positive > 0 && classes[0].negative > 0")
    page["undo"].click()
    page.wait_for_state("classes[0].positive === 0 && classes[0].negative === 0")

    # A click says what to do.
    page.click_in("Red", box["width"] / 2, box["height"] / 2)
    page.wait_for_state("message.includes('Hold the left button down')")
    page.wait_for_state("classes[0].positive === 0")


@pytest.fixture(params=[1, 2])
def on_screen(request: pytest.FixtureRequest, browser: Any, noise_server: Any, pictures: Path) -> Iterator[tuple[AppPage, int]]:
    """A page that shows noise, on screens of so many pixels per point, of which ordinary ones have one."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, device_scale_factor=request.param)
    page = AppPage(context.new_page(), pictures)
    page.page.goto(noise_server.address)
    page.wait_for_state("volume_name === 'noise' && opening === ''")
    yield page, request.param
    context.close()


@pytest.mark.slow
def test_the_length_is_as_large_on_screens_with_dense_pixels(on_screen: tuple[AppPage, int]) -> None:
    page, pixels_per_point = on_screen
    begin_with_a_structure(page)
    page["tool-diameter"].click()
    page.page.wait_for_function("window.trame.state.get('tool') === 'diameter'")
    box = page["view-Red"].bounding_box()
    x, y = box["width"] / 2, box["height"] / 2

    def white_rows(picture: np.ndarray) -> float:
        """How many rows above where the line ends have something white, in points."""
        top, bottom, left, right = (round(pixels_per_point * place) for place in (y - 60, y - 5, x - 10, x + 110))
        return float((picture[top:bottom, left:right].min(axis=2) > 200).any(axis=1).sum()) / pixels_per_point

    page.wait_for_picture("Red", lambda picture: white_rows(picture) > 0)
    for end, value in (("high", "10001"), ("low", "10000")):
        page[f"window-{end}"].fill(value)
        page[f"window-{end}"].press("Enter")
    page.wait_for_picture("Red", lambda picture: white_rows(picture) == 0)
    page.page.mouse.move(box["x"] + x - 50, box["y"] + y)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + x + 50, box["y"] + y)
    # The digits of letters of 14 points.
    page.wait_for_picture("Red", lambda picture: 8 <= white_rows(picture) <= 13)
    page.keep_picture(f"length with {pixels_per_point} pixels per point")
    page.page.mouse.up()
    page.page.keyboard.press("z")
    page["window-0"].click()
    page.wait_for_picture("Red", lambda picture: white_rows(picture) > 0)


def begin_with_a_structure(page: AppPage) -> None:
    """Have one, which tests of the same server share, with another tool in hand than what is tested."""
    if not page["tool-diameter"].is_visible():
        page["add-class"].click()
    page["tool-pointOff"].click()
    page.page.wait_for_function("window.trame.state.get('tool') === 'pointOff'")


def is_blue(picture: np.ndarray) -> np.ndarray:
    """Where a view shows the line's colour."""
    red, _, blue = np.moveaxis(picture.astype(int), 2, 0)
    return blue - red > 100


def tools_fit(page: AppPage) -> bool:
    """Whether all tools stand in one row, beside a scroll bar, which browsers with a window have."""
    # Measured at once: what stands above them may grow by a line at any time.
    row_right, *boxes = (
        page["tool-eraser"]
        .locator("xpath=..")
        .evaluate(
            """row => [row.getBoundingClientRect().right, ...[...row.children].map(tool => {
            const box = tool.getBoundingClientRect(); return [box.top, box.right];
        })]"""
        )
    )
    return len({top for top, _ in boxes}) == 1 and max(right for _, right in boxes) <= row_right - SCROLL_BAR_PX
