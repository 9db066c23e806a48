"""What becomes of the page, and of what was done on it, where its connection breaks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Testing.support.network import Network
from ViTTransferFunction.Testing.support.web_app import AppPage, Server, is_painted

pytestmark = pytest.mark.slow


def port_of(address: str) -> int:
    return int(address.split(":")[2].split("/")[0])


@pytest.fixture
def network(noise_server: Server) -> Iterator[Network]:
    network = Network(port_of(noise_server.address))
    yield network
    network.close()


@pytest.fixture
def address(noise_server: Server, network: Network) -> str:
    scheme, host, rest = noise_server.address.split(":")
    return f"{scheme}:{host}:{network.port}/{rest.split('/', 1)[1]}"


@pytest.fixture
def page(new_page: Callable[[], Any], address: str) -> AppPage:
    """The app by way of the network, with a new structure and the tool for its points in hand."""
    page = new_page()
    page.page.goto(address)
    begin_structure(page)
    return page


def begin_structure(page: AppPage) -> None:
    """Wait until the page is there, and take the tool for the points of a new structure."""
    page.wait_for_state("volume_name === 'noise' && opening === ''")
    before = page.page.evaluate("trame.state.get('classes').length")
    page.page.keyboard.press("Escape")
    page["add-class"].click()
    page.wait_for_state(f"classes.length === {before + 1} && state.get('tool') === 'pointOn'")
    page.page.evaluate(f"window.first = {before}")
    # Those of the tools: requests that are under way when a network falls silent keep others from getting through.
    page.page.wait_for_function("[...document.images].every((image) => image.complete)")


def wait_for_connection(page: AppPage, state: str) -> None:
    """Wait until the page shows its connection to be so: "", "waiting", "lost", "elsewhere" or "anew"."""
    page.page.wait_for_function(f"(document.querySelector('.connection').dataset.state || '') === '{state}'")


def wait_for_points(page: AppPage, *numbers: int) -> None:
    """Wait until the structures since the page was opened have such numbers of points."""
    page.wait_for_state(f"classes.slice(first).map((item) => item.positive).join() === '{','.join(map(str, numbers))}'")


def go_on(page: AppPage, network: Network, points: int) -> None:
    """Once the page shows that its connection is lost, have the network come up, click once more, and wait for the points."""
    wait_for_connection(page, "lost")
    network.come_up()
    wait_for_connection(page, "")
    page.click_in("Red", 190, 150)
    wait_for_points(page, points)


def test_a_connection_that_broke_comes_back_by_itself_and_the_page_goes_on(page: AppPage, network: Network) -> None:
    page.click_in("Red", 150, 150)
    wait_for_points(page, 1)
    network.go_down()
    wait_for_connection(page, "lost")
    page.keep_picture("lost")
    page.page.keyboard.press("z")
    go_on(page, network, points=2)
    page.wait_for_picture("Red", lambda picture: is_painted(picture, 190, 150, radius=3))


def test_a_click_that_was_lost_on_its_way_is_placed_once(page: AppPage, network: Network) -> None:
    page.click_in("Red", 150, 150)
    wait_for_points(page, 1)
    page.page.mouse.move(page["view-Red"].bounding_box()["x"] + 170, page["view-Red"].bounding_box()["y"] + 150)
    page.page.wait_for_function("window.requests.awaited() === null")
    network.go_down(after_sending=False)
    page.page.mouse.down()
    page.page.mouse.up()
    go_on(page, network, points=3)


def test_clicks_that_arrived_without_an_answer_are_placed_once(page: AppPage, network: Network) -> None:
    # What the page hears of them is lost, and it sends them again.
    page.page.evaluate("""() => {
        const send = WebSocket.prototype.send;
        WebSocket.prototype.send = function (...message) {
            this.onmessage = null;
            return send.apply(this, message);
        };
        window.hearAgain = () => { WebSocket.prototype.send = send; };
    }""")
    page.click_in("Red", 150, 150)
    page.click_in("Red", 170, 150)
    page.page.wait_for_function("window.requests.awaited() !== null")
    page.page.wait_for_timeout(1000)
    page.page.evaluate("window.hearAgain()")
    network.go_down()
    go_on(page, network, points=3)


def test_a_connection_that_is_dead_without_a_word_is_replaced(page: AppPage, network: Network) -> None:
    network.fall_silent()
    page.click_in("Red", 150, 150)
    wait_for_connection(page, "waiting")
    page.keep_picture("waiting")
    page["add-class"].click()
    page.click_in("Red", 170, 150)
    wait_for_connection(page, "lost")
    wait_for_connection(page, "")
    wait_for_points(page, 1, 1)


def test_a_page_that_another_tab_replaced_does_not_quarrel_with_it(page: AppPage, address: str) -> None:
    other = AppPage(page.page.context.new_page(), page._pictures)
    other.page.goto(address)
    other["app"].wait_for()
    wait_for_connection(page, "elsewhere")
    page.keep_picture("elsewhere")
    other.page.evaluate("window.first = trame.state.get('classes').length - 1")
    other.click_in("Red", 150, 150)
    wait_for_points(other, 1)
    page.page.get_by_role("button", name="Go on here").click()
    page["app"].wait_for()
    page.wait_for_state("classes.at(-1).positive === 1")
    wait_for_connection(other, "elsewhere")


def test_who_stays_on_a_page_that_asks_before_it_is_closed_goes_on(page: AppPage) -> None:
    page.click_in("Red", 150, 150)
    wait_for_points(page, 1)
    page.page.wait_for_function("trame.state.get('unsaved')")
    page.page.once("dialog", lambda dialog: dialog.dismiss())
    page.page.evaluate("setTimeout(() => { location.href = 'about:blank'; }, 0)")
    wait_for_connection(page, "lost")
    wait_for_connection(page, "")
    page.click_in("Red", 190, 150)
    wait_for_points(page, 2)


@pytest.mark.parametrize(
    ("file", "arrives"),
    [
        # Without which there is no program at all; which opens the first connection; and with which the page goes on by itself.
        ("vue.global.js", False),
        ("assets/index-*.js", True),
        ("__vittf/requests.js", False),
        ("__vittf/touch.js", False),
    ],
)
def test_a_page_whose_connection_breaks_while_it_is_loaded_comes_up_by_itself(
    new_page: Callable[[], Any], address: str, network: Network, file: str, arrives: bool
) -> None:
    page = new_page()

    def break_off(route: Any) -> None:
        response = route.fetch()
        network.go_down()
        if arrives:
            route.fulfill(response=response)
        else:
            route.abort()

    page.page.route(f"**/{file}", break_off, times=1)
    page.page.goto(address, wait_until="commit")
    page.page.get_by_text("This page comes up by itself").wait_for()
    page.keep_picture("not loaded")
    network.come_up()
    begin_structure(page)
    # What was there of the page before had every reason for them.
    page.errors.clear()
    page.click_in("Red", 150, 150)
    wait_for_points(page, 1)


def test_what_is_shown_while_the_page_is_loaded_does_not_come_over_it(new_page: Callable[[], Any], address: str) -> None:
    page = new_page()
    held: list[Any] = []
    page.page.route("**/loading.tpl", lambda route: held.append(route))
    page.page.goto(address)
    page["add-class"].wait_for()
    for route in held:
        with page.page.expect_response("**/loading.tpl"):
            route.continue_()
    begin_structure(page)
    page.click_in("Red", 150, 150)
    wait_for_points(page, 1)


def test_a_page_that_does_not_come_is_loaded_anew(new_page: Callable[[], Any], address: str) -> None:
    page = new_page()
    page.page.clock.install()
    page.page.route("**/__vittf/requests.js", lambda route: None, times=1)
    page.page.goto(address, wait_until="commit")
    page.page.wait_for_function("document.querySelector('.connection')")
    page.page.clock.fast_forward(61_000)
    page.page.get_by_text("This page comes up by itself").wait_for()
    with page.page.expect_navigation(wait_until="commit"):
        page.page.clock.fast_forward(2000)
    begin_structure(page)
    page.errors.clear()


def test_a_page_of_which_a_part_never_comes_is_used_without_it(new_page: Callable[[], Any], address: str) -> None:
    page = new_page()
    page.page.route("**/__vittf/touch.js", lambda route: route.abort())
    page.page.goto(address, wait_until="commit")
    page.page.wait_for_function("sessionStorage.getItem('vittf loaded again') === '5'")
    begin_structure(page)
    page.errors.clear()
    page.click_in("Red", 150, 150)
    wait_for_points(page, 1)


def test_an_app_that_was_started_anew_is_not_taken_for_the_one_before(page: AppPage) -> None:
    # Any other server of the app knows nothing of this page's token.
    page.page.route("**/served?*", lambda route: route.fulfill(status=403, body="No entry"))
    page.page.evaluate("trame.client.getConnection().getSession().close()")
    wait_for_connection(page, "anew")
    page.keep_picture("anew")


@pytest.mark.parametrize("changes", ["the name", "websockets"])
def test_where_a_proxy_keeps_the_page_from_the_app_the_page_says_why(
    new_page: Callable[[], Any], noise_server: Server, changes: str
) -> None:
    def change(data: bytes) -> bytes:
        if changes == "websockets":
            return data.replace(b"\r\nUpgrade: websocket", b"")
        return data.replace(b"Host: 127.0.0.1:%d" % network.port, b"Host: 127.0.0.1:%d" % port)

    port = port_of(noise_server.address)
    network = Network(port, change)
    called = f"page of http://127.0.0.1:{network.port}, but the app was called 127.0.0.1:{port}"
    page = new_page()
    page.page.goto(noise_server.address.replace(f":{port}/", f":{network.port}/"))
    page.page.get_by_role("status").get_by_text(called if changes == "the name" else "websockets").wait_for()
    page.keep_picture(changes)
    network.close()
    page.page.goto(noise_server.address)
    begin_structure(page)
    page.errors.clear()


def test_a_browser_that_is_too_old_says_so_and_waits_for_nothing(new_page: Callable[[], Any], address: str) -> None:
    page = new_page()
    page.page.add_init_script("delete AbortSignal.timeout")
    page.page.goto(address)
    page.page.get_by_text("This browser is too old").wait_for()
    # This one is not, so that the page comes up below; closed before, it would miss what it had not loaded yet.
    page.page.wait_for_function("window.requests && document.querySelector('.connection')")
    page.keep_picture("too old")


def test_what_the_server_says_comes_in_its_order_however_long_browsers_read(page: AppPage) -> None:
    order = page.page.evaluate("""async () => {
        const read = Blob.prototype.arrayBuffer;
        let patience = 500;
        Blob.prototype.arrayBuffer = async function () {
            await new Promise((done) => setTimeout(done, (patience -= 20)));
            return read.call(this);
        };
        const order = [];
        const ask = (number) => window.requests.ask("arrive").then(() => order.push(number));
        await Promise.all([0, 1, 2, 3, 4].map(ask));
        Blob.prototype.arrayBuffer = read;
        return order;
    }""")
    assert order == [0, 1, 2, 3, 4]
