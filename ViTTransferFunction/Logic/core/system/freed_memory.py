"""Memory that the program has freed, and the C library keeps."""

from __future__ import annotations

import ctypes
import sys


def give_back_freed_memory() -> None:
    """Give freed memory back to the operating system. Takes some milliseconds, after work that needed much memory.

    On Linux, the C library (glibc) keeps freed memory for the thread that asked for it, or between blocks that are in use.
    Other threads, and arrays that are larger than the gaps, get new memory meanwhile. Other systems are left as they are.
    """
    if sys.platform == "linux":
        # Other C libraries than glibc lack it.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(ctypes.c_size_t(0))
