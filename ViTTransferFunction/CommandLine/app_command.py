"""`vittf app`: the tool in a browser, on this computer or, through a tunnel, on another."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ViTTransferFunction.CommandLine.interruption import Terminated
from ViTTransferFunction.CommandLine.options import Subparsers, add_series_option, add_settings_options, session_settings
from ViTTransferFunction.Logic.core.system.errors import InputError

if TYPE_CHECKING:
    from ViTTransferFunction.WebApp.app import WebApp

LOOP_TURNS_S = 0.01
"""In which the loop hears of signals that came before."""
CONSOLE_GONE = (2, 5, 6)
"""Windows' events of a console whose window was closed, or whose user logs off or shuts down."""
ENDING_S = 20.0
"""Longer than Windows waits for what a program does when its console goes."""
NEWEST_PYTHON = (3, 13)
"""Slicer's scene (slicer-core) is not built for later ones."""


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to a parser."""
    parser = subparsers.add_parser(
        "app",
        help="segment interactively in a browser, where Slicer is not installed",
        description="Serves a page with slice views, a 3D view and the tools of the Slicer module, and prints its address. "
        "It ends when the page is closed, or by Ctrl-C.",
    )
    parser.add_argument(
        "volume", metavar="VOLUME", type=Path, nargs="?", help="an image file, a DICOM folder, or a saved session (.mrb)"
    )
    add_series_option(parser)
    parser.add_argument("--sample", action="store_true", help="open the chest CT of the Python package slicerio")
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen at; with any but the default, other computers can reach the page"
    )
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port to listen at; 0, the default: any free one")
    parser.add_argument("--no-browser", action="store_true", help="print the address, and open no browser")
    add_settings_options(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Serve until the page is closed, or somebody asks for the end."""
    import asyncio

    _check(args)
    settings = _parameters(args)
    # Trame reads the command line as well, unless told what it is.
    os.environ["TRAME_ARGS"] = ""
    asyncio.run(_serve(args, settings))
    return 0


def _check(args: argparse.Namespace) -> None:
    if not 0 <= args.port <= 65535:
        raise InputError(f"Port {args.port} does not exist; expected 0 to 65535, with 0 for any free one.")
    if args.sample and args.volume:
        raise InputError("Either a volume or --sample, not both.")
    if args.volume is not None and not args.volume.exists():
        raise InputError(f"{args.volume} does not exist. Give an image file, a DICOM folder, or a saved session (.mrb).")
    if args.series is not None and not (args.volume and args.volume.is_dir()):
        raise InputError("--series says which of a DICOM folder's series to open; give that folder as VOLUME.")
    session_settings(args)  # Refuses what cannot be used.
    if find_spec("slicer") is None or find_spec("trame_slicer") is None:
        if sys.version_info[:2] > NEWEST_PYTHON:
            newest = ".".join(map(str, NEWEST_PYTHON))
            raise InputError(f"The app needs Slicer's scene, which is not there for this Python; use 3.10 to {newest}.")
        raise InputError('The app needs trame-slicer, which is not installed: pip install "vit-transfer-function[app]".')


def _parameters(args: argparse.Namespace) -> dict[str, Any]:
    """The options as `SceneParameters` has them."""
    parameters: dict[str, Any] = {"preset": args.preset, "device": args.device}
    if args.model:
        parameters["model"] = args.model
    if args.weights:
        parameters["weightsPath"] = str(Path(args.weights).absolute())
    if args.grid:
        parameters["grid"] = args.grid
    if args.window:
        low, high = args.window
        parameters |= {"windowAutomatic": False, "windowLow": low, "windowHigh": high}
    return parameters


async def _serve(args: argparse.Namespace, settings: dict[str, Any]) -> None:
    import asyncio
    import webbrowser

    def announce(address: str) -> None:
        print(f"Open {address}", flush=True)
        if not args.no_browser:
            webbrowser.open(address)

    def warn(warning: str) -> None:
        print(f"note: {warning}", file=sys.stderr, flush=True)

    loop = asyncio.get_running_loop()
    app: WebApp | None = None
    asked: list[int] = []

    def hear(number: int) -> None:
        asked.append(number)
        if app is not None:
            app.stop()

    handled = {number: signal.getsignal(number) for number in _ending_signals()}
    for number in handled:
        # In the loop's turn, not in the midst of Slicer's code, which an exception can crash: also while that is loaded, and
        # while the scene is made.
        _have_loop_hear(number, hear)
    _hear_when_console_goes(lambda: loop.call_soon_threadsafe(hear, signal.SIGTERM))
    try:
        from ViTTransferFunction.WebApp.app import WebApp
        from ViTTransferFunction.WebApp.volumes import sample_path

        await asyncio.sleep(LOOP_TURNS_S)
        if asked:
            raise KeyboardInterrupt if asked[0] == signal.SIGINT else Terminated
        volume = sample_path() if args.sample else args.volume
        app = WebApp(settings)
        await app.start(args.host, args.port, volume, announce, warn, args.series)
    finally:
        for number, before in handled.items():
            if sys.platform == "win32":
                signal.signal(number, before)
            else:
                loop.remove_signal_handler(number)


def _ending_signals() -> list[int]:
    if sys.platform == "win32":
        return [signal.SIGINT, signal.SIGBREAK]
    # The terminal was closed; `nohup` has programs go on.
    hang_up = [signal.SIGHUP] if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL else []
    return [signal.SIGINT, signal.SIGTERM, *hang_up]


def _have_loop_hear(number: int, hear: Callable[[int], object]) -> None:
    """Have the running loop call `hear` in its turn when a signal comes, with its number."""
    import asyncio

    loop = asyncio.get_running_loop()
    if sys.platform == "win32":
        # Loops have no signals there. What Python calls instead, between any two of its instructions, only leaves a note.
        signal.signal(number, lambda number, _: loop.call_soon_threadsafe(hear, number))
    else:
        loop.add_signal_handler(number, hear, number)


def _hear_when_console_goes(tell: Callable[[], object]) -> None:
    """Have Windows call `tell`, by a thread of its own, when the window is closed that the program prints to.

    It ends the program once that call has returned, and after some seconds in any case: the files on their way would stay.
    """
    if sys.platform != "win32":
        return
    import ctypes

    @ctypes.WINFUNCTYPE(ctypes.c_int, ctypes.c_uint)
    def heard(event: int) -> int:
        if event not in CONSOLE_GONE:
            return 0  # Whoever else hears of it.
        with suppress(RuntimeError):  # The loop has ended already.
            tell()
            time.sleep(ENDING_S)
        return 1

    _heard_by_windows.append(heard)
    ctypes.windll.kernel32.SetConsoleCtrlHandler(heard, 1)


_heard_by_windows: list[object] = []
"""Python would let go of what only Windows knows of."""
