"""One cohort at a time in a folder of results."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.file_lock import is_at, take_lock

LOCK = ".cohort.lock"


@contextmanager
def only_cohort_in(folder: Path) -> Iterator[None]:
    """Keep other cohorts out of a folder: each would write its own cases only into the table, and remove what others write.

    The operating system opens the lock however this program ends. Where the disk knows no locks, nobody is kept out.

    Raises:
        InputError: another cohort is at work there, on this computer or on another that shares the disk and its locks.
    """
    descriptor = _locked(folder)
    if descriptor is None:
        yield
        return
    try:
        yield
    finally:
        # Before it is closed, so that nobody else has it by then; but Windows removes no open file.
        _remove(folder / LOCK)
        os.close(descriptor)
        if sys.platform == "win32":
            _remove(folder / LOCK)


def _locked(folder: Path) -> int | None:
    """The lock's file, locked; None where it cannot be had. Raises InputError where another cohort has it."""
    while (descriptor := _opened(folder)) is not None:
        taken = take_lock(descriptor)
        if taken is False:
            os.close(descriptor)
            raise InputError(
                f"Another cohort is writing to {folder}. Wait until it has ended, or name another folder by --output."
            )
        if taken is None or is_at(folder / LOCK, descriptor):
            return descriptor
        # A cohort that has just ended removed it after it was opened here: the next one would make and lock another file.
        os.close(descriptor)
    return None


def _opened(folder: Path) -> int | None:
    """The lock's file; None where it cannot be had: another user's, say. Whether results can be written, others tell."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        return None


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
