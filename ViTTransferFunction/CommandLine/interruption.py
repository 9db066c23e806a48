"""Ending early, by Ctrl-C or on request, so that what was being written is tidied up."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Terminated(KeyboardInterrupt):
    """Somebody asked the program to end: a scheduler whose time is up, say. It ends as if it were interrupted."""

    exit_code = 143
    """As shells have it: 128 and the number of the signal."""


@contextmanager
def ending_on_request() -> Iterator[None]:
    """Within, SIGTERM raises `Terminated`; otherwise Python would be gone at once, and leave what it was writing.

    It is raised as well where a library that was interrupted raised something of its own instead, as NumPy does while it
    compares arrays.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # Only the main thread hears signals.
        return
    asked: list[Terminated] = []

    def terminate(number: int, frame: FrameType | None) -> None:
        asked.append(Terminated())
        raise asked[0]

    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    except Exception as error:
        if asked and interruption_behind(error) is None:
            raise asked[0] from error
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def interruption_behind(error: BaseException) -> KeyboardInterrupt | None:
    """The interruption that an error is, or was raised while handling: closing a half-written archive complains, say."""
    behind: BaseException | None = error
    while behind is not None and not isinstance(behind, KeyboardInterrupt):
        behind = behind.__context__
    return behind
