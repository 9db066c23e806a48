"""Ending early, by Ctrl-C or on request, so that what was being written is tidied up."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

AGAIN_AFTER_S = 0.01
"""By then, what the interruption was lost in has ended."""


class Terminated(KeyboardInterrupt):
    """Somebody asked the program to end: a scheduler whose time is up, say. It ends as if it were interrupted."""

    exit_code = 143
    """As shells have it: 128 and the number of the signal."""


@contextmanager
def ending_on_request() -> Iterator[None]:
    """Within, SIGTERM raises `Terminated` as Ctrl-C raises KeyboardInterrupt, and neither gets lost.

    Without this, SIGTERM ends Python at once, and leaves what it was writing. An interruption is raised as well where another
    error came of it: closing a half-written archive complains, and NumPy, comparing arrays, raises an error of its own
    instead. One that comes while Python deletes an object is dropped there, with a line on the console; it comes again.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # Only the main thread hears signals.
        return
    asked: list[KeyboardInterrupt] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        asked.append(Terminated() if number == signal.SIGTERM else KeyboardInterrupt())
        raise asked[-1]

    with _handled_by(interrupt), _coming_again():
        try:
            yield
        except Exception as error:
            interruption = _interruption_behind(error) or (asked[0] if asked else None)
            if interruption is None:
                raise
            raise interruption from None


@contextmanager
def _handled_by(interrupt: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    if before[signal.SIGINT] is not signal.default_int_handler:
        # A shell's background programs do not hear Ctrl-C, and who embeds this one may handle it in another way.
        del before[signal.SIGINT]
    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _coming_again() -> Iterator[None]:
    """Send the signal again where its interruption could not be raised."""
    report = sys.unraisablehook

    def again(unraisable: sys.UnraisableHookArgs) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            report(unraisable)
            return
        number = signal.SIGTERM if isinstance(unraisable.exc_value, Terminated) else signal.SIGINT
        threading.Timer(AGAIN_AFTER_S, _send, (number,)).start()

    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = report


def _send(number: signal.Signals) -> None:
    main = threading.main_thread().ident
    if sys.platform == "win32" or main is None:
        signal.raise_signal(number)
    else:
        # To that thread, so that it wakes where it waits for something.
        signal.pthread_kill(main, number)


def _interruption_behind(error: BaseException) -> KeyboardInterrupt | None:
    """The interruption that an error was raised while handling."""
    behind: BaseException | None = error
    while behind is not None and not isinstance(behind, KeyboardInterrupt):
        behind = behind.__context__
    return behind
