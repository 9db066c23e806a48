"""A lock on a file, which the operating system releases however the program that holds it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def take_lock(descriptor: int) -> bool | None:
    """Take a file's lock, which is released when the file is closed.

    Args:
        descriptor: descriptor of the open file.

    Returns:
        True: the lock is taken; False: another process, or another descriptor of the file, holds it; None: the file system has
        no locks.
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
    """Whether an open file is still at its path; except on Windows, the previous holder of its lock may have removed it."""
    try:
        return sys.platform == "win32" or os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
