"""How much memory a step takes."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable


def peak_bytes(step: Callable[[], object]) -> int:
    """What numpy and Python allocate at the most while `step` runs, beyond what there was before; run twice.

    The first time, what is kept for good is made.
    """
    step()
    tracemalloc.start()
    try:
        step()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
