"""The app in a browser: a process that serves it, and what a user sees and does on its page."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from PIL import Image

from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S

ROOT = Path(__file__).parents[3]

STATE = (
    "phase",
    "up_to_date",
    "busy",
    "progress",
    "classes",
    "message",
    "opening",
    "volume_name",
    "written",
    "outdated",
    "unsaved",
    "settings",
)
"""Names in the page's state that tests wait for."""

NETWORK_S = 0.3
"""How long what is sent takes over a slow network."""
SLOW_NETWORK = f"""() => {{
    const send = WebSocket.prototype.send;
    window.usesOfViews = 0;
    WebSocket.prototype.send = function (message, ...more) {{
        if (new TextDecoder().decode(message).includes("use_view")) usesOfViews += 1;
        setTimeout(() => send.call(this, message, ...more), {1000 * NETWORK_S:.0f});
    }};
}}"""
"""Has whatever a page sends take a while, in its order; counts what is sent of what is done in views."""

_PROGRAM = """
import sys
from ViTTransferFunction.WebApp import browser_session
# A browser that gets no time from the processors ends pages without having them say so.
browser_session.SECONDS_TO_RETURN = browser_session.SECONDS_TO_RECONNECT = {seconds_to_return}
from ViTTransferFunction.CommandLine.vittf import main
sys.exit(main(sys.argv[1:]))
"""


class Server:
    """`vittf app` in a process of its own.

    Args:
        arguments: of the command, beside those that have it open no browser.
        cache: folder for its features.
        seconds_to_return: from the closing of a tab to the end.

    Attributes:
        address: what it printed.
    """

    def __init__(self, *arguments: str | Path, cache: Path, seconds_to_return: float = 600.0) -> None:
        environment = {"PYTHONPATH": str(ROOT), "VITTF_CACHE": str(cache), "OMP_WAIT_POLICY": "passive", **os.environ}
        program = _PROGRAM.format(seconds_to_return=seconds_to_return)
        # Several servers may have one cache.
        self._log = tempfile.NamedTemporaryFile("w+", dir=cache, suffix=".log", delete=False, encoding="utf-8")  # noqa: SIM115
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, "app", *map(str, arguments), "--no-browser"],
            cwd=cache, env=environment, stdout=subprocess.PIPE, stderr=self._log, encoding="utf-8",
        )  # fmt: skip
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, f"the server ended with {self.process.wait()}: {self.log()}"
        self.address = line.split()[-1]

    def log(self) -> str:
        """What it wrote to stderr so far."""
        self._log.flush()
        return (Path(self._log.name)).read_text(encoding="utf-8")

    def processes(self) -> list[psutil.Process]:
        """Itself, and all that it started."""
        process = psutil.Process(self.process.pid)
        return [process, *process.children(recursive=True)]

    def processor_s(self) -> float:
        """How long they have used a processor so far."""
        times = [process.cpu_times() for process in self.processes()]
        return sum(each.user + each.system for each in times)

    def interrupt(self) -> int:
        """Press Ctrl-C in its terminal; returns the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(LONGEST_WAIT_S)

    def close(self) -> None:
        """End it, whatever it does."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(LONGEST_WAIT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._log.close()


@contextmanager
def serving(*arguments: str | Path, cache: Path, **options: Any) -> Iterator[Server]:
    """A server that is ended with the block."""
    server = Server(*arguments, cache=cache, **options)
    try:
        yield server
        # A defect that the app goes on after.
        assert "Something unexpected went wrong" not in server.log()
    finally:
        server.close()


def still_running(processes: list[psutil.Process]) -> list[psutil.Process]:
    """Those of some processes that do not end; zombies, which only wait for their parent to take notice, have ended."""
    _, alive = psutil.wait_procs(processes, timeout=0)
    alive = [process for process in alive if process.is_running() and process.status() != psutil.STATUS_ZOMBIE]
    _, alive = psutil.wait_procs(alive, timeout=LONGEST_WAIT_S)
    return [process for process in alive if process.is_running() and process.status() != psutil.STATUS_ZOMBIE]


class AppPage:
    """The page as a user has it.

    Args:
        page: Playwright's.
        pictures: folder for a picture of each step.
    """

    def __init__(self, page: Any, pictures: Path) -> None:
        self.page = page
        self._pictures = pictures
        self.errors: list[str] = []
        page.set_default_timeout(1000.0 * LONGEST_WAIT_S)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._note_failure)

    def _note_failure(self, message: Any) -> None:
        if "Content Security Policy" in message.text or "405" in message.text:
            self.errors.append(message.text)

    def __getitem__(self, test_id: str) -> Any:
        """The element of a `data-testid`."""
        return self.page.get_by_test_id(test_id)

    def click(self, test_id: str) -> None:
        """Click on an element."""
        self[test_id].click()

    def wait_for_state(self, condition: str) -> None:
        """Wait until a JavaScript condition on the page's state holds, `phase === "ready"` say."""
        names = ", ".join(STATE)
        values = ", ".join(f"state.get('{name}')" for name in STATE)
        program = f"""() => {{
            const state = window.trame?.state;
            if (state?.get('phase') === undefined) return false;
            const [{names}] = [{values}];
            return {condition};
        }}"""
        self.page.wait_for_function(program)

    def wait_for_drawing(self) -> None:
        """Wait until the page has been drawn as its state is now."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self, view: str) -> np.ndarray:
        """What a view shows, (rows, columns, 3) uint8."""
        png = self[f"view-{view}"].screenshot(animations="disabled")
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))

    def keep_picture(self, name: str) -> None:
        """Keep a picture of the whole page, numbered by the order of the steps."""
        self._pictures.mkdir(parents=True, exist_ok=True)
        number = len(list(self._pictures.glob("*.png"))) + 1
        self.page.screenshot(path=self._pictures / f"{number:02d} {name}.png", animations="disabled")

    def wait_for_picture(self, view: str, condition: Callable[[np.ndarray], bool]) -> np.ndarray:
        """Wait until what a view shows meets a condition; returns it. Pictures come when they are drawn."""
        end = time.monotonic() + LONGEST_WAIT_S
        while not condition(picture := self.picture(view)):
            assert time.monotonic() < end, f"the view {view} did not come to show what was expected"
        return picture

    def click_in(self, view: str, column: float, row: float) -> None:
        """Click in a view, at pixels from its upper left corner."""
        box = self[f"view-{view}"].bounding_box()
        self.page.mouse.click(box["x"] + column, box["y"] + row)

    def turn_wheel(self, view: str, turns: list[tuple[int, float]]) -> None:
        """Turn the wheel over a view several times at once, each by its mode (0: pixels, 1: lines) and how far."""
        self[f"view-{view}"].evaluate(
            """(view, turns) => {
                const picture = view.querySelector("img"), { x, y } = picture.getBoundingClientRect();
                for (const [deltaMode, deltaY] of turns) {
                    const turn = { deltaMode, deltaY, clientX: x + 9, clientY: y + 9, bubbles: true, cancelable: true };
                    picture.dispatchEvent(new WheelEvent("wheel", turn));
                }
            }""",
            turns,
        )

    def rename(self, row: int, name: str) -> None:
        """Give the structure of a row of the table another name."""
        self[f"class-name-{row}"].dblclick()
        self[f"class-name-{row}"].fill(name)
        self[f"class-name-{row}"].press("Enter")
        self.wait_for_state(f"classes[{row}].name === {json.dumps(name)}")

    def extent_in(self, view: str) -> tuple[int, int, int, int]:
        """Where the volume lies in a slice view, which shows its middle: first and last column and row, in pixels."""
        window = {end: float(self[f"window-{end}"].input_value()) for end in ("low", "high")}
        self._set_window("low", -10001.0)
        self._set_window("high", -10000.0)
        # All of the volume is white then, and around it is black; the view has a slider at its lower end.
        picture = self.wait_for_picture(view, lambda picture: _white(picture).mean() > 0.2)
        columns, rows = (np.flatnonzero(_white(picture).mean(axis=axis) > 0.3) for axis in (0, 1))
        self._set_window("high", window["high"])
        self._set_window("low", window["low"])
        self.wait_for_picture(view, lambda picture: _white(picture).mean() < 0.2)
        return int(columns[0]), int(columns[-1]), int(rows[0]), len(picture) - 1 - int(rows[0])

    def _set_window(self, end: str, value: float) -> None:
        self[f"window-{end}"].fill(str(value))
        self[f"window-{end}"].press("Enter")
        self.page.wait_for_function(f"Math.abs(window.trame.state.get('window').{end} - {value}) < 0.01")


def _white(picture: np.ndarray) -> np.ndarray:
    return picture.min(axis=2) > 230


def change_near(before: np.ndarray, after: np.ndarray, column: float, row: float, radius: int = 8) -> float:
    """Mean change of colour around a pixel, of 255, without what lies right at it: the point that was placed."""
    rows, columns = np.ogrid[: before.shape[0], : before.shape[1]]
    distance = np.hypot(rows - row, columns - column)
    ring = (distance > 0.6 * radius) & (distance < 2 * radius)
    return float(np.abs(after.astype(int) - before.astype(int))[ring].mean())


def is_painted(picture: np.ndarray, column: float, row: float, radius: int = 8) -> bool:
    """Whether something coloured lies over the grey image beside a pixel."""
    beside = picture[int(row) - radius : int(row) + radius, int(column) + radius : int(column) + 2 * radius].astype(int)
    return bool(np.ptp(beside, axis=2).mean() > 15)


def changed_share(before: np.ndarray, after: np.ndarray) -> float:
    """The share of pixels whose colour changed so much that people see it."""
    return float((np.abs(after.astype(int) - before.astype(int)).max(axis=2) > 30).mean())
