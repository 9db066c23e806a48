"""Temporary folders that only the user can enter; they are removed when the program that made them ends.

If that program is killed, or the computer goes down, its folders are removed when one of our programs next makes such a folder.
"""

from __future__ import annotations

import atexit
import os
import re
import shutil
import stat
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from .errors import InputError
from .file_lock import take_lock

PREFIX = "vittf-"
LOCK = ".vittf-lock"
"""A file in each folder, locked for as long as the program that made the folder runs."""
YOUNG_S = 60.0
"""In a folder younger than this, the program that made it may not have taken the lock yet."""

_NAME = re.compile(rf"{PREFIX}\w{{8}}")

_tidied: set[Path] = set()
"""The places in which this process has already looked for abandoned folders."""


class PrivateFolder(tempfile.TemporaryDirectory[str]):
    """A new folder that only the user can enter; removed with its content, at the latest when the program ends.

    Args:
        place: the folder to make it in; None: the system's folder for temporary files.
    """

    def __init__(self, place: Path | None) -> None:
        super().__init__(prefix=PREFIX, dir=place, ignore_cleanup_errors=True)
        self._lock: int | None = os.open(Path(self.name, LOCK), os.O_RDWR | os.O_CREAT, 0o600)
        take_lock(self._lock)
        for each in (Path(self.name).parent, Path(tempfile.gettempdir())):
            _tidy(each)

    def cleanup(self) -> None:
        """Remove the folder and its content."""
        if self._lock is not None:
            # Windows does not remove open files.
            os.close(self._lock)
            self._lock = None
        super().cleanup()
        # Another file in it may still be open, because it is being sent or compressed, say.
        if Path(self.name).exists():
            atexit.register(shutil.rmtree, self.name, ignore_errors=True)


def private_folder(place: Path | None = None) -> PrivateFolder:
    """Make a `PrivateFolder`.

    Raises:
        InputError: it cannot be made, for example because the disk is full.
    """
    try:
        return PrivateFolder(place)
    except OSError as error:
        raise InputError(
            f"No temporary files can be kept: {error.strerror or error}. Make room on the disk for them, or have the variable "
            "TMPDIR name another folder and start again."
        ) from error


def _tidy(place: Path) -> None:
    """Remove the folders that programs which have ended left behind in `place`; once in each process."""
    if place in _tidied:
        return
    _tidied.add(place)
    with suppress(OSError):
        for folder in place.iterdir():
            if _NAME.fullmatch(folder.name) and _is_left(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _is_left(folder: Path) -> bool:
    """Whether a folder belongs to this user, and was made by a program that has ended."""
    with suppress(OSError):
        if not (_is_ours(folder) and stat.S_ISDIR(folder.lstat().st_mode) and _is_ours(folder / LOCK)):
            return False
        descriptor = os.open(folder / LOCK, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
        try:
            return time.time() - os.fstat(descriptor).st_mtime > YOUNG_S and take_lock(descriptor) is True
        finally:
            os.close(descriptor)
    return False


def _is_ours(path: Path) -> bool:
    return not hasattr(os, "getuid") or path.lstat().st_uid == os.getuid()
