"""Seconds spent in each step of a run, and the memory that it took."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class Stopwatch:
    """Adds up wall-clock seconds by step: `with watch.step("features"): …`.

    Attributes:
        seconds: by step, in the order in which the steps were first entered.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time what happens inside; a step entered again goes on counting."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


def peak_memory_bytes() -> int | None:
    """Largest resident memory of this process so far; None where the platform does not tell without further packages."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if sys.platform == "darwin":
        return peak
    # That of Linux begins with the peak of the program that started this one.
    own = _own_peak_kib()
    return 1024 * (peak if own is None else own)


def _own_peak_kib() -> int | None:
    """As Linux counts it for this program alone; None where its kernel is one that does not."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), None)
