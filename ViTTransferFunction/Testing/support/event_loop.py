"""An event loop that is to Python's threads what Slicer's is: it holds Python's lock, also while it idles.

PySide's loop gives the lock back, and so hides whatever a thread cannot do in the instants that Slicer leaves it.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

POLL_S, CLICK_POLL_S = 0.01, 0.002
"""How often the panel has Slicer's timer call it while something runs, and while the answer to a click is under way."""

_system = ctypes.PyDLL("kernel32" if sys.platform == "win32" else None)
"""Its functions, other than those of a CDLL, are called with the lock held."""


def idle_with_the_lock(seconds: float) -> None:
    """Wait as Slicer's event loop does."""
    if sys.platform == "win32":
        _system.Sleep(int(1e3 * seconds))
    else:
        _system.usleep(int(1e6 * seconds))


def polls_until(finished: Callable[[], bool], most: int = 18_000) -> int:
    """Run the loop until `finished`, which is asked at every tick of its timer; how often it was."""
    for polls in range(1, most + 1):
        if finished():
            return polls
        idle_with_the_lock(POLL_S)
    raise AssertionError(f"nothing came in {most} polls")
