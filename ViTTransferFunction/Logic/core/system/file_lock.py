"""A lock on a file that the operating system opens however the program that has it ends."""

from __future__ import annotations

import sys


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
