"""Folders for files that are on their way: only the user can enter them, and they go with the program that made them.

What one leaves that is killed, or whose computer goes down, goes when a program of ours next makes such a folder.
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
"""In each folder: locked as long as the program runs that made it."""
YOUNG_S = 60.0
"""The lock of a folder that is younger may just be about to be taken."""

_NAME = re.compile(rf"{PREFIX}\w{{8}}")

_tidied: set[Path] = set()
"""Where this process has looked for what others left."""


class PrivateFolder(tempfile.TemporaryDirectory[str]):
    """A new folder that only the user can enter; it goes with all that is in it, at the latest when the program ends.

    Args:
        place: the folder to make it in; None: the one for temporary files.
    """

    def __init__(self, place: Path | None) -> None:
        super().__init__(prefix=PREFIX, dir=place, ignore_cleanup_errors=True)
        self._lock: int | None = os.open(Path(self.name, LOCK), os.O_RDWR | os.O_CREAT, 0o600)
        take_lock(self._lock)
        for each in (Path(self.name).parent, Path(tempfile.gettempdir())):
            _tidy(each)

    def cleanup(self) -> None:
        """Remove it."""
        if self._lock is not None:
            # Windows removes no open file.
            os.close(self._lock)
            self._lock = None
        super().cleanup()
        # Nor one that is being sent or compressed, say.
        if Path(self.name).exists():
            atexit.register(shutil.rmtree, self.name, ignore_errors=True)


def private_folder(place: Path | None = None) -> PrivateFolder:
    """Make one; see `PrivateFolder`.

    Raises:
        InputError: it cannot be made: the disk is full, say.
    """
    try:
        return PrivateFolder(place)
    except OSError as error:
        raise InputError(
            f"No temporary files can be kept: {error.strerror or error}. Make room on the disk for them, or have the variable "
            "TMPDIR name another folder and start again."
        ) from error


def _tidy(place: Path) -> None:
    """Remove what programs of ours left that run no more; once in each process."""
    if place in _tidied:
        return
    _tidied.add(place)
    with suppress(OSError):
        for folder in place.iterdir():
            if _NAME.fullmatch(folder.name) and _is_left(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _is_left(folder: Path) -> bool:
    """Whether a folder is this user's, and of a program that has ended."""
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
