"""Over a slow network, what is done in a view comes before what is asked for after it."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Testing.support.web_app import SLOW_NETWORK, AppPage

pytestmark = pytest.mark.slow


@pytest.fixture
def page(at_noise: AppPage) -> AppPage:
    """The app over a slow network, with a new structure and the tool for its points in hand."""
    page = at_noise
    before = page.page.evaluate("trame.state.get('classes').length")
    page.page.keyboard.press("Escape")
    page["add-class"].click()
    page.wait_for_state(f"classes.length === {before + 1} && state.get('tool') === 'pointOn'")
    page.page.evaluate(f"window.first = {before}")
    page.page.evaluate(SLOW_NETWORK)
    return page


def wait_for_points(page: AppPage, *numbers: str) -> None:
    """Wait until the new structure and those that were added after it have such numbers of points, and no more are there."""
    conditions = [f"classes[first + {index}]?.positive {number}" for index, number in enumerate(numbers)]
    page.wait_for_state(f"classes.length === first + {len(numbers)} && " + " && ".join(conditions))


def test_a_click_is_one_in_the_structure_that_was_selected_then(page: AppPage) -> None:
    page.click_in("Red", 150, 150)
    page["add-class"].click()
    page.click_in("Red", 170, 150)
    page["add-class"].click()
    wait_for_points(page, "=== 1", "=== 1", "=== 0")


def test_clicks_and_turns_of_the_wheel_stay_in_their_order(page: AppPage) -> None:
    before, step = (float(value) for value in (page["slice-Red"].input_value(), page["slice-Red"].get_attribute("step") or ""))
    page.click_in("Red", 150, 150)
    page.page.mouse.wheel(0, 100)
    page.page.mouse.wheel(0, 100)
    page.click_in("Red", 170, 150)
    page.page.mouse.wheel(0, 100)
    wait_for_points(page, "=== 2")
    points = page.page.evaluate("fetch('download/points').then((answer) => answer.json())")["classes"][-1]["positive"]
    np.testing.assert_allclose([point[2] for point in points], [before, before - 2 * step], atol=step / 4)


def test_a_click_counts_where_the_mouse_leaves_the_view_at_once(page: AppPage) -> None:
    page.click_in("Red", 150, 150)
    page.page.mouse.move(5, 5)
    wait_for_points(page, "=== 1")


def test_a_key_undoes_the_click_before_it(page: AppPage) -> None:
    page.click_in("Red", 150, 150)
    page.click_in("Red", 170, 150)
    page.page.keyboard.press("z")
    page["add-class"].click()
    wait_for_points(page, "=== 1", "=== 0")


def test_none_of_several_quick_clicks_is_lost(page: AppPage) -> None:
    for column in range(130, 230, 20):
        page.click_in("Red", column, 150)
    page["add-class"].click()
    wait_for_points(page, "=== 5", "=== 0")


def test_a_stroke_is_one_in_the_structure_that_was_selected_then(page: AppPage) -> None:
    page["tool-brushOn"].click()
    box = page["view-Red"].bounding_box()
    page.page.mouse.move(box["x"] + 130, box["y"] + 150)
    page.page.mouse.down()
    for by in range(10, 100, 10):
        page.page.mouse.move(box["x"] + 130 + by, box["y"] + 150)
    page.page.mouse.up()
    page["add-class"].click()
    wait_for_points(page, "> 0", "=== 0")


@pytest.mark.parametrize(
    ("turns", "slices"), [([(0, 100)] * 3, 3), ([(1, 3)] * 3, 3), ([(0, 3)] * 31, 4), ([(0, 40), (0, -40), (0, -40)], -1)]
)
def test_a_notch_of_a_mouse_is_a_slice_and_touchpads_leaf_no_faster(
    page: AppPage, turns: list[tuple[int, float]], slices: int
) -> None:
    page["slice-Red"].fill("10")
    page.page.wait_for_function("window.requests.awaited() === null")
    shown = "Number(document.querySelector('[data-testid=slice-Red]').value)"
    before, step = page.page.evaluate(shown), float(page["slice-Red"].get_attribute("step") or "")
    page.turn_wheel("Red", turns)
    page["add-class"].click()
    wait_for_points(page, "=== 0", "=== 0")
    page.page.wait_for_function(f"Math.abs({shown} - {before - slices * step}) < {step / 4}")
