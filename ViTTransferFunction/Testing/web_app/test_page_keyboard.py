"""The page without a mouse, for those who cannot see it, and on a small screen."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from PIL import Image

from ViTTransferFunction.Testing.support.web_app import AppPage

pytestmark = pytest.mark.slow

STRUCTURES = 8
CONTROLS = "button, input, select, summary, a[href], [tabindex='0']"
FOLDED = ("appearance", "pictures", "segmentation", "advanced")

NUMBER_ALL = f"""() => {{
    const seen = [...document.querySelectorAll("{CONTROLS}")].filter((one) => !one.disabled && one.checkVisibility());
    seen.forEach((one, index) => {{ one.dataset.number = index; }});
    return seen.map((one) => one.outerHTML.slice(0, 200));
}}"""
"""Numbers all controls that can be seen and used."""
FOCUSED = """() => {
    const one = document.activeElement;
    const outlined = [one, one.closest("label")].some((box) => box && getComputedStyle(box).outlineStyle !== "none");
    return [one.dataset.number ?? "", outlined];
}"""
"""Number of the control that has the focus, and whether that can be seen."""
BEYOND = """() => [...document.querySelectorAll(".panel *")].filter((one) => {
    const edge = document.querySelector(".panel").getBoundingClientRect().right;
    return one.checkVisibility() && one.getBoundingClientRect().right > edge;
}).map((one) => one.outerHTML.slice(0, 200))"""
"""What of the panel lies beyond its edge."""
LYING_OVER_EACH_OTHER = """() => {
    const sides = ["top", "left", "right", "bottom"].map((side) => `.side.${side}`);
    const parts = [".view-name", ".view-buttons", ...sides, ".offset", "input.slice"];
    const boxOf = (one) => {
        const content = document.createRange();
        content.selectNodeContents(one);
        return (one.childNodes.length ? content : one).getBoundingClientRect();
    };
    const share = (a, b, start, end) => Math.min(a[end], b[end]) - Math.max(a[start], b[start]) > 1;
    const meet = (a, b) => share(a, b, "left", "right") && share(a, b, "top", "bottom");
    const found = [];
    for (const view of document.querySelectorAll("[data-view]")) {
        const there = parts.filter((part) => view.querySelector(part));
        const boxes = there.map((part) => boxOf(view.querySelector(part)));
        there.forEach((part, index) => {
            if (boxes[index].right > view.getBoundingClientRect().right) found.push([part, "edge"]);
            there.slice(0, index).forEach((other, before) => {
                if (meet(boxes[index], boxes[before])) found.push([part, other]);
            });
        });
    }
    return found;
}"""
"""Pairs of what is written or can be pressed in a view, of which one covers the other, or which the view cuts off."""
NAMED_ROLES = ("button", "checkbox", "combobox", "slider", "spinbutton", "textbox", "link", "ColorWell", "DisclosureTriangle")


@pytest.fixture
def page(at_noise: AppPage) -> AppPage:
    """The page with eight structures, and with all that is folded away open."""
    page = at_noise
    # A page that is closed takes along what it has not sent yet: that its list of keys was closed, say.
    page.page.evaluate("window.trame.state.set('asking_help', false)")
    page["help"].wait_for(state="detached")
    for number in range(page.page.evaluate("window.trame.state.get('classes').length"), STRUCTURES):
        page["add-class"].click()
        page[f"class-{number}"].wait_for()
    for name in FOLDED:
        if page[name].get_attribute("open") is None:
            page[name].locator("summary").click()
    page["cache"].wait_for()
    return page


def test_nothing_is_wider_than_a_small_screen(page: AppPage) -> None:
    for _ in ("dark", "light"):
        for end in ("open", "remove-model"):
            page[end].scroll_into_view_if_needed()
            page.wait_for_drawing()
            page.keep_picture(f"everything open, to {end}")
        assert page.page.evaluate("document.documentElement.scrollWidth") <= 1280
        assert page.page.evaluate("(box => box.scrollWidth - box.clientWidth)(document.querySelector('.sections'))") <= 0
        assert page.page.evaluate(BEYOND) == []
        page["theme"].click()


def test_on_a_page_that_is_enlarged_to_twice_its_size_all_of_a_view_can_be_read(page: AppPage) -> None:
    page.page.set_viewport_size({"width": 600, "height": 500})
    try:
        page.wait_for_drawing()
        page.keep_picture("enlarged to twice its size")  # In a window of 1200×1000 pixels.
        assert page.page.evaluate(LYING_OVER_EACH_OTHER) == []
    finally:
        page.page.set_viewport_size({"width": 1280, "height": 800})


def test_on_an_upright_narrow_screen_the_views_lie_above_the_panel(page: AppPage) -> None:
    page.page.set_viewport_size({"width": 400, "height": 800})
    try:
        page.wait_for_drawing()
        page.keep_picture("upright and narrow")
        views = [page[f"view-{name}"].bounding_box() for name in ("Red", "Green", "Yellow", "ThreeD")]
        assert min(box["width"] for box in views) >= 190
        assert min(box["height"] for box in views) >= 190
        assert max(box["y"] + box["height"] for box in views) <= page.page.locator(".panel").bounding_box()["y"]
        assert page.page.evaluate(BEYOND) == []
    finally:
        page.page.set_viewport_size({"width": 1280, "height": 800})


def test_where_the_system_sets_the_colours_sliders_eyes_and_what_is_chosen_are_seen(page: AppPage) -> None:
    page["class-0"].click(position={"x": 5, "y": 5})
    page["tool-brushOn"].click()
    page.wait_for_state("state.get('tool') === 'brushOn' && state.get('selected') === classes[0].id")
    page.page.emulate_media(forced_colors="active")
    try:
        page.keep_picture("colours of the system")
        for name in ("proximity", "overlayOpacity", "slice-Red", "class-visible-0"):
            page[name].scroll_into_view_if_needed()
            picture = Image.open(io.BytesIO(page[name].screenshot(animations="disabled"))).convert("L")
            assert np.ptp(np.asarray(picture, int)) > 100, name
        for name in ("class-0", "tool-brushOn"):
            assert page[name].evaluate("one => getComputedStyle(one).outlineStyle") == "solid", name
        assert page["class-1"].evaluate("one => getComputedStyle(one).outlineStyle") == "none"
    finally:
        page.page.emulate_media(forced_colors="none")


def test_a_hidden_structure_s_eye_is_struck_through_and_not_only_darker(page: AppPage) -> None:
    struck = "one => getComputedStyle(one, '::after').content !== 'none'"
    assert not page["class-visible-0"].evaluate(struck)
    page["class-visible-0"].click()
    page.wait_for_state("!classes[0].visible")
    page.wait_for_drawing()
    assert page["class-visible-0"].evaluate(struck)
    page["class-visible-0"].click()
    page.wait_for_state("classes[0].visible")


def test_the_tab_key_leads_to_every_control_and_shows_where_it_is(page: AppPage) -> None:
    controls = page.page.evaluate(NUMBER_ALL)
    assert len(controls) > 80
    reached, unseen = set(), []
    for _ in range(len(controls) + 20):
        page.page.keyboard.press("Tab")
        number, outlined = page.page.evaluate(FOCUSED)
        reached.add(number)
        if number and not outlined:
            unseen.append(controls[int(number)])
    assert [control for number, control in enumerate(controls) if str(number) not in reached] == []
    assert unseen == []


@pytest.mark.parametrize("view", ["Red", "ThreeD"])
def test_a_view_that_the_tab_key_leads_to_is_outlined_where_it_is_not_cut_off(page: AppPage, view: str) -> None:
    focused = f"document.activeElement.matches('[data-view={view}] .remote-controlled-area')"
    while not page.page.evaluate(focused):
        page.page.keyboard.press("Tab")
    at_right_edge = np.median(page.picture(view)[:, -3:], axis=0).tolist()
    assert [108, 180, 238] in at_right_edge


def test_no_digit_that_is_pressed_in_a_view_has_it_drawn_for_coloured_glasses(page: AppPage) -> None:
    page["view-Red"].locator(".remote-controlled-area").focus()
    page.page.keyboard.press("3")
    # What is drawn next, and so after the digit.
    before = page["slice-Red"].input_value()
    page.page.keyboard.press("f")
    page.page.wait_for_function("before => document.querySelector('[data-testid=slice-Red]').value !== before", arg=before)
    page["view-Red"].locator(".remote-controlled-area").evaluate("one => one.blur()")
    page.wait_for_picture("Red", lambda picture: picture[100:-100, 100:-100].max() > 100)
    picture = page.picture("Red")[100:-100, 100:-100].astype(int)
    assert np.abs(picture[..., 0] - picture[..., 1]).max() < 40


def test_screen_readers_are_told_of_which_view_a_button_is_and_where_its_slice_lies(page: AppPage) -> None:
    for name in ("Axial", "3D", "Coronal", "Sagittal"):
        view = page.page.get_by_role("group", name=name, exact=True)
        assert view.get_by_role("button", name="Enlarge").count() == 1, name
    shown = page["view-Red"].locator(".offset").inner_text()
    assert page["slice-Red"].get_attribute("aria-valuetext") == shown


def test_screen_readers_have_a_name_for_every_control(page: AppPage) -> None:
    nodes = page.page.context.new_cdp_session(page.page).send("Accessibility.getFullAXTree")["nodes"]
    controls = [node for node in nodes if not node.get("ignored") and _value(node, "role") in NAMED_ROLES]
    assert len(controls) > 80
    assert [node for node in controls if not _value(node, "name")] == []


def test_tools_have_the_names_of_the_panel_and_of_its_guide(page: AppPage) -> None:
    for name in ("Add structure", "Inside", "Outside", "Brush in", "Lasso out", "Outline", "Diameter", "Erase"):
        assert page.page.get_by_role("button", name=name, exact=True).count() == 1, name
    assert page["tool-pointOff"].get_attribute("title") == "Outside: place points outside the structure (N)"


@pytest.mark.parametrize("control", ["tool-lassoOn", "tool-eraser", "save-session"])
def test_a_hand_that_shakes_presses_what_it_is_on(page: AppPage, control: str) -> None:
    page.page.evaluate("""window.pressed = [];
        document.addEventListener("click", (event) => {
            pressed.push(event.target.closest("[data-testid]").dataset.testid);
            event.preventDefault();
        })""")
    page[control].scroll_into_view_if_needed()
    box = page[control].bounding_box()
    x, y = box["x"] + box["width"] / 2 - 5, box["y"] + box["height"] / 2
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x + 10, y + 3, steps=5)
    page.page.mouse.up()
    page.page.wait_for_function(f"pressed.includes('{control}')")
    page.page.keyboard.press("Escape")
    page.wait_for_state("state.get('tool') === ''")


def test_buttons_that_are_pressed_again_and_again_stay_where_they_are(page: AppPage) -> None:
    page["larger"].scroll_into_view_if_needed()
    before, sizes = page["larger"].bounding_box(), ["as chosen"]
    while page["larger"].is_enabled():
        page["larger"].click()
        is_new = "text => document.querySelector('[data-testid=size-text]').textContent !== text"
        page.page.wait_for_function(is_new, arg=sizes[-1])
        sizes.append(page["size-text"].inner_text())
        assert page["larger"].bounding_box() == before, sizes
    assert len(sizes) > 3
    page["size-as-chosen"].click()


def test_of_many_structures_that_were_not_saved_five_are_named(page: AppPage) -> None:
    kept = {"points": 9, "when_ms": 0, "names": list("ABCDEFG")}
    page.page.evaluate("(kept) => window.trame.state.set('restorable', kept)", kept)
    page["restorable"].get_by_text("not saved: A, B, C, D, E and 2 more.").wait_for()
    page.page.evaluate("() => window.trame.state.set('restorable', null)")
    page["restorable"].wait_for(state="detached")


def test_of_a_long_name_in_arabic_the_beginning_is_shown(page: AppPage) -> None:
    before = page["class-name-0"].input_value()
    page.rename(0, "الكلية اليسرى: 70% تضيق في الشريان الكلوي")
    direction = "field => [getComputedStyle(field).direction, getComputedStyle(field).textAlign, field.scrollLeft]"
    assert page["class-name-0"].evaluate(direction) == ["rtl", "left", 0]
    page.keep_picture("a long name in Arabic")
    page.rename(0, before)
    assert page["class-name-0"].evaluate(direction) == ["ltr", "left", 0]


def test_however_many_warnings_there_are_the_table_of_structures_stays_in_sight(page: AppPage) -> None:
    page.page.set_viewport_size({"width": 1280, "height": 640})
    set_status = "status => window.trame.state.set('status', status)"
    before = page.page.evaluate("window.trame.state.get('status')")
    try:
        page.page.evaluate("document.querySelector('.sections').scrollTop = 0")
        warnings = "\n".join(f"⚠ Structure {number}: 2 points outside the volume do not count." for number in range(20))
        page.page.evaluate(set_status, warnings)
        page["status"].get_by_text("Structure 19").wait_for()
        page.wait_for_drawing()
        page.keep_picture("many warnings")
        box, end = page["class-0"].bounding_box(), page["write-segments"].bounding_box()
        assert box["y"] + box["height"] < end["y"]
    finally:
        page.page.evaluate(set_status, before)
        page.page.set_viewport_size({"width": 1280, "height": 800})


def test_who_clicks_without_features_is_told_what_is_missing_until_they_are_begun(page: AppPage) -> None:
    set_state = "([name, value]) => window.trame.state.set(name, value)"
    page.page.evaluate(set_state, ["missing", "Points show their structure once the features are computed."])
    page["features-missing"].get_by_text("Points show their structure").wait_for()
    page.page.evaluate(set_state, ["missing", ""])
    page["features-missing"].wait_for(state="detached")


def test_the_list_of_keys_says_which_of_them_work_in_the_table_alone(page: AppPage) -> None:
    page.page.get_by_title("Keyboard shortcuts (?)").click()
    plain, _, of_table = page["help"].inner_text().partition("In the table of structures:")
    assert "erase points" in plain
    assert "remove the structure" in of_table
    page.page.keyboard.press("Escape")
    page["help"].wait_for(state="detached")


def test_what_is_unfolded_comes_into_sight(page: AppPage) -> None:
    page["advanced"].locator("summary").click()
    page.wait_for_state("state.get('advanced_open') === false")
    page.page.set_viewport_size({"width": 1280, "height": 500})
    try:
        page["advanced"].locator("summary").click()
        page.page.wait_for_function(
            """() => {
              const [part, panel] = [".sections details:last-child", ".sections"].map((one) =>
                document.querySelector(one).getBoundingClientRect());
              return part.height > panel.height && Math.abs(part.top - panel.top) < 2;
            }"""
        )
    finally:
        page.page.set_viewport_size({"width": 1280, "height": 800})


def test_a_structure_is_chosen_renamed_and_removed_by_keys(page: AppPage) -> None:
    page["class-2"].focus()
    page.page.keyboard.press("Enter")
    page.wait_for_state("classes.length === 8")
    page.page.wait_for_function("window.trame.state.get('selected') === window.trame.state.get('classes')[2].id")
    page.page.keyboard.press("F2")
    page.page.keyboard.type("liver")
    page.page.keyboard.press("Enter")
    page.wait_for_state("classes[2].name === 'liver'")
    page["class-2"].focus()
    page.page.keyboard.press("Delete")
    page.wait_for_state("classes.length === 7")


def test_a_key_that_is_held_down_takes_up_a_tool_once_and_removes_one_structure(page: AppPage) -> None:
    keyboard = page.page.keyboard
    for _ in range(4):  # The browser says of all but the first that they are repetitions.
        keyboard.down("e")
    keyboard.up("e")
    page.page.wait_for_function("window.trame.state.get('tool') === 'eraser'")
    page["class-2"].focus()
    for _ in range(3):
        keyboard.down("Delete")
    keyboard.up("Delete")
    page.wait_for_state(f"classes.length === {STRUCTURES - 1}")
    # By the answer to this, what was asked before has been done.
    keyboard.press("n")
    page.page.wait_for_function("window.trame.state.get('tool') === 'pointOff'")
    page.wait_for_state(f"classes.length === {STRUCTURES - 1}")


def test_where_all_structures_were_removed_buttons_bring_them_back(page: AppPage) -> None:
    for left in reversed(range(STRUCTURES)):
        page["class-remove-0"].click()
        page.wait_for_state(f"classes.length === {left}")
    page.keep_picture("nothing left")
    page["undo"].click()
    page["class-0"].wait_for()
    page["redo"].click()
    page.wait_for_state("classes.length === 0")
    page["undo"].click()
    page["class-0"].wait_for()


def test_ctrl_with_z_y_and_s_undoes_redoes_and_saves_as_in_other_programs(page: AppPage) -> None:
    before = page.page.evaluate("window.trame.state.get('classes').length")
    page["add-class"].click()
    page.wait_for_state(f"classes.length === {before + 1}")
    for keys, count in (("z", before), ("y", before + 1), ("z", before), ("Shift+z", before + 1), ("z", before)):
        page.page.keyboard.press(f"ControlOrMeta+{keys}")
        page.wait_for_state(f"classes.length === {count}")
    with page.page.expect_download() as download:
        page.page.keyboard.press("ControlOrMeta+s")
    assert download.value.suggested_filename == "noise.mrb"


ASKED_BY = """([where, keys]) => {
    const asked = [], ask = window.requests.ask;
    window.requests.ask = (name, [action]) => asked.push(action);
    for (const key of keys) {
        document.querySelector(where).dispatchEvent(new KeyboardEvent("keydown", {bubbles: true, ...key}));
    }
    window.requests.ask = ask;
    return asked;
}"""
"""What the page asks for when keys are pressed in an element."""


def test_signs_may_be_on_altgr_as_windows_reports_it_or_on_option(page: AppPage) -> None:
    on_windows = {"key": "[", "ctrlKey": True, "altKey": True}
    on_a_mac = {"key": "]", "altKey": True}
    assert page.page.evaluate(ASKED_BY, ["body", [on_windows, on_a_mac]]) == ["smaller", "larger"]
    others = [{"key": "[", "ctrlKey": True}, {"key": "a", "altKey": True}, {"key": "a", "ctrlKey": True, "altKey": True}]
    assert page.page.evaluate(ASKED_BY, ["body", others]) == []


PREVENTED = """([test_id, key]) => {
    const pressed = new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true });
    document.querySelector(`[data-testid='${test_id}']`).dispatchEvent(pressed);
    return pressed.defaultPrevented;
}"""
"""Whether the page keeps a key that is pressed in an element from the browser."""


@pytest.mark.parametrize("key", ["/", "'"])
def test_firefox_is_not_to_search_the_page_for_the_keys_of_tools(page: AppPage, key: str) -> None:
    assert page.page.evaluate(PREVENTED, ["app", key])
    assert not page.page.evaluate(PREVENTED, ["grid", key])


def test_the_selected_structure_is_in_sight_in_a_long_table(page: AppPage) -> None:
    for number in range(page.page.evaluate("window.trame.state.get('classes').length"), STRUCTURES + 4):
        page["add-class"].click()
        page[f"class-{number}"].wait_for()
    within = """() => {
        const row = document.querySelector("[data-class-row][aria-current='true']").getBoundingClientRect();
        const table = document.querySelector(".classes").getBoundingClientRect();
        return row.top >= table.top - 1 && row.bottom <= table.bottom + 1;
    }"""
    page.page.wait_for_function(within)
    page["app"].click(position={"x": 5, "y": 5})
    # The next one after the last is the first.
    page.page.keyboard.press("w")
    page.page.wait_for_function("window.trame.state.get('selected') === window.trame.state.get('classes')[0].id")
    page.page.wait_for_function(within)


def test_keys_of_the_table_work_on_the_structure_that_has_the_focus(page: AppPage) -> None:
    names = page.page.evaluate("window.trame.state.get('classes').map((one) => one.name)")
    page["class-4"].focus()
    page.page.keyboard.press("Enter")
    page.page.wait_for_function("window.trame.state.get('selected') === window.trame.state.get('classes')[4].id")
    page["class-1"].focus()
    page.page.keyboard.press("Alt+ArrowDown")
    page.wait_for_state(f"classes[2].name === '{names[1]}' && classes[1].name === '{names[2]}'")
    page["class-0"].focus()
    page.page.keyboard.press("Delete")
    page.wait_for_state(f"classes.length === {len(names) - 1}")
    assert names[0] not in page.page.evaluate("window.trame.state.get('classes').map((one) => one.name)")


def test_a_structure_that_was_moved_keeps_the_keyboard(page: AppPage) -> None:
    row = page.page.evaluate("window.trame.state.get('classes')[4].id")
    page["class-4"].focus()
    for key, place in (("ArrowUp", 3), ("ArrowUp", 2), ("ArrowDown", 3)):
        page.page.keyboard.press(f"Alt+{key}")
        page.wait_for_state(f"classes[{place}].id === '{row}'")
        page.page.wait_for_function(f"document.activeElement.dataset.classRow === '{row}'")


def test_on_a_mac_its_key_delete_removes_a_structure(page: AppPage) -> None:
    before = page.page.evaluate("window.trame.state.get('classes').length")
    backspace = [{"key": "Backspace"}]
    assert page.page.evaluate(ASKED_BY, ["[data-testid='class-0']", backspace]) == []
    page.page.add_init_script("Object.defineProperty(navigator, 'platform', { value: 'MacIntel' })")
    page.page.reload()
    page["class-0"].wait_for()
    page["class-0"].focus()
    page.page.keyboard.press("Backspace")
    page.wait_for_state(f"classes.length === {before - 1}")


def test_esc_leaves_a_structure_its_name_and_the_tool_in_hand(page: AppPage) -> None:
    page["tool-eraser"].click()
    page.page.wait_for_function("window.trame.state.get('tool') === 'eraser'")
    before = page["class-name-2"].input_value()
    page["class-2"].focus()
    page.page.keyboard.press("F2")
    page.page.keyboard.type("half a na")
    page.page.keyboard.press("Escape")
    assert page["class-name-2"].input_value() == before
    assert page["class-name-2"].get_attribute("readonly") is not None
    page["class-3"].focus()
    page.page.keyboard.press("F2")
    page.page.keyboard.type("spleen")
    page.page.keyboard.press("Enter")
    page.wait_for_state("classes[3].name === 'spleen'")
    assert page.page.evaluate("window.trame.state.get('classes')[2].name") == before
    assert page.page.evaluate("window.trame.state.get('tool')") == "eraser"


def test_a_dialog_has_the_keyboard_until_esc_gives_it_back(page: AppPage) -> None:
    page.page.get_by_title("Keyboard shortcuts (?)").click()
    page["help"].wait_for()
    page["open"].focus()
    page.page.keyboard.press("Enter")
    page["open-dialog"].wait_for()
    inside = "document.querySelector('.dialog').contains(document.activeElement)"
    page.page.wait_for_function(inside)
    focused = "document.activeElement"
    outside = f"{inside} || {focused} === document.body ? '' : {focused}.outerHTML.slice(0, 300)"
    for _ in range(12):
        page.page.keyboard.press("Tab")
        assert page.page.evaluate(outside) == ""
    page["open-path"].focus()
    page.page.keyboard.press("Escape")
    page["open-dialog"].wait_for(state="detached")
    page.page.wait_for_function("document.activeElement.dataset.testid === 'open'")


def _value(node: dict[str, Any], name: str) -> str:
    return str(node.get(name, {}).get("value", ""))
