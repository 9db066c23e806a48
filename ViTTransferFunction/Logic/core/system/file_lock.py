"""A lock on a file that the operating system opens however the program that has it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def take_lock(descriptor: int) -> bool | None:
    """Take a file's lock, which closing the file gives back.

    Returns:
        True: it is taken; False: another process, or another opening of the file, has it; None: the disk knows no locks.
    """
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return None
    return True


def is_at(path: Path, descriptor: int) -> bool:
    """Whether an open file still lies at its path: who had its lock before may have removed it, but not on Windows."""
    try:
        return sys.platform == "win32" or os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
