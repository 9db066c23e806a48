"""Files that are written completely or not at all: under a temporary name, flushed to the disk, then renamed."""

from __future__ import annotations

import errno
import math
import os
import re
import secrets
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError
from .regular_file import check_length, mode_of, not_regular

_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}
"""Errors for a full disk, a file that is too large, and an exceeded quota (unknown on Windows)."""

_NOT_OFFERED = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""Errors of some network shares for operations that they do not support."""

_LONGEST_ENDING = 16

TEMPORARY = ".writing-"
"""Prefix of the names of temporary files."""

_TEMPORARY_NAME = re.compile(rf"{re.escape(TEMPORARY)}[0-9a-f]{{8}}(\..*)?")

ABANDONED_S = 24 * 3600.0
"""A temporary file unchanged for this long is no longer written to, neither here nor on a computer that shares the folder."""

_SCANNERS_TAKE_S, _RETRY_S = 2.0, 0.05

_tidied: set[Path] = set()
"""Folders that this process has already searched for abandoned temporary files."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; on success it takes `path`'s place, on failure it is removed.

    The temporary file has the same ending as `path`, in lower case, since many writers choose their format by it. It is renamed
    only after it has been flushed to the disk, so that a file that was reported as written survives a power failure. Temporary
    files of killed processes are removed from the folder when they are `ABANDONED_S` old.

    Raises:
        InputError: the folder cannot be written to, the disk is full, or `path` is a folder, a pipe or a device.
    """
    _check_replaceable(path)
    # The name is known before the file exists, so that the file is removed wherever an interruption comes.
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        rights = _make(temporary)
        yield temporary
        _flush(temporary)
        set_rights(temporary, rights)
        _put_in_place(temporary, path)
        _tidy(path.parent)
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        # An error of the removal must not hide the one that ended the work.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def set_rights(path: Path, rights: int) -> None:
    """Set the access rights of a file or folder, if its disk allows this; otherwise they stay as they are.

    On a Windows share that is mounted for everybody, for example, only the user who mounted it may change rights.
    """
    try:
        path.chmod(rights)
    except OSError as error:
        if not isinstance(error, PermissionError) and error.errno not in _NOT_OFFERED:
            raise


def check_writable(path: Path) -> None:
    """Raise InputError if `path` cannot be written, before work is spent on its content. Leaves no files behind."""
    _check_replaceable(path)
    if sys.platform == "win32":
        _check_folders_of_windows(path)
    folder = next((parent for parent in path.absolute().parents if mode_of(parent) is not None), None)
    if folder is None:
        # On Windows, each disk and each network share has a root of its own.
        disk = path.absolute().anchor
        raise InputError(f"Cannot write {path}: there is no disk {disk}, or it is out of reach. Connect it, or choose another.")
    try:
        _make_and_remove_file(folder)
    except OSError as error:
        raise _cannot_write(path, error) from error


def _check_folders_of_windows(path: Path) -> None:
    """Refuse folders whose names end in spaces or dots: Windows creates them without these, and then does not find them."""
    for name in path.parent.parts:
        if name.endswith((" ", "..")) and name.strip(". "):
            raise InputError(
                f"Cannot write {path}: no folder's name may end in a space or in dots on Windows ({name!r}). Choose another."
            )


def _make_and_remove_file(folder: Path) -> None:
    if sys.platform == "win32":
        # In a write-protected folder, `tempfile` of Python 3.12 and earlier takes every name for used, and tries 2**31 names.
        flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_TEMPORARY
        os.close(os.open(_temporary(folder / "file"), flags, 0o600))
        return
    with tempfile.TemporaryFile(dir=folder):
        pass


def remove_leftovers(folder: Path, changed_before_s: float = math.inf) -> None:
    """Remove this user's temporary files from a folder, which killed processes have left. Nobody may be writing them.

    Args:
        folder: the folder; nothing happens if it cannot be read.
        changed_before_s: only files that were last changed before this time are removed, in seconds since the epoch.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            # Only files with our names are examined, since there may be many others.
            if _TEMPORARY_NAME.fullmatch(path.name):
                _remove_leftover(path, changed_before_s)


def _remove_leftover(path: Path, changed_before_s: float) -> None:
    with suppress(OSError):
        status = path.lstat()
        ours = not hasattr(os, "getuid") or status.st_uid == os.getuid()
        if ours and stat.S_ISREG(status.st_mode) and status.st_mtime < changed_before_s:
            path.unlink()


def _put_in_place(temporary: Path, path: Path) -> None:
    """Rename. Windows refuses this while another program has either file open, as virus scanners do with new files."""
    give_up = time.monotonic() + _SCANNERS_TAKE_S
    while sys.platform == "win32" and time.monotonic() < give_up:
        with suppress(PermissionError):
            temporary.replace(path)
            return
        time.sleep(_RETRY_S)
    temporary.replace(path)


def _tidy(folder: Path) -> None:
    """Remove abandoned files; once for each folder, as it takes time to list a folder with many results."""
    if folder not in _tidied:
        _tidied.add(folder)
        remove_leftovers(folder, time.time() - ABANDONED_S)


def _cannot_write(path: Path, error: OSError) -> InputError:
    """The InputError for a file that the operating system could not write."""
    if error.errno in _FULL:
        return InputError(
            f"Cannot write {path}: the disk is full, or your share of it. Free some space or choose another folder."
        )
    advice = "Choose a folder that you can write to."
    if sys.platform == "win32" and isinstance(error, PermissionError):
        advice = "Close other programs that have it open, or choose a folder that you can write to."
    return InputError(f"Cannot write {path}: {error.strerror or error}. {advice}")


def _check_replaceable(path: Path) -> None:
    """Raise InputError unless `path` can be replaced by a file: a rename would replace a device, and fail late for a folder."""
    if sys.platform == "win32" and ":" in path.name:
        # Windows would report it late, because it takes the text after a colon for the name of a stream of the file.
        raise InputError(f"Cannot write {path}: no name may hold a colon (:) on Windows. Choose another name.")
    check_length(path, max(0, len(_temporary(path).name) - len(path.name)))
    mode = mode_of(path)
    if mode is None:
        return
    if stat.S_ISDIR(mode):
        raise InputError(f"Cannot write {path}: it is a folder; name a file.")
    if not stat.S_ISREG(mode):
        raise not_regular(path)
    if not os.access(path, os.W_OK):
        # Renaming would bypass the protection, and fail on Windows.
        raise InputError(f"Cannot write {path}: the file is write-protected. Choose another name.")


def _temporary(path: Path) -> Path:
    """A temporary path for the file that will replace `path`."""
    return path.parent / f"{TEMPORARY}{secrets.token_hex(4)}{_ending(path)}"


def _ending(path: Path) -> str:
    """The last two suffixes, such as `.nii.gz`, shortened if long, to limit the length of the temporary file's name."""
    return "".join(path.suffixes[-2:]).lower()[-_LONGEST_ENDING:]


def _make(temporary: Path) -> int:
    """Create a file that only its owner may read while it is being written; returns the usual rights of new files here."""
    descriptor = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    try:
        # Read from the file, because Python can only read the umask by changing it, which would affect other threads.
        rights = stat.S_IMODE(os.fstat(descriptor).st_mode)
        set_rights(temporary, 0o600)
    finally:
        os.close(descriptor)
    return rights


def _flush(path: Path) -> None:
    """Flush the file to the disk. Some file systems notice only now that there is no room."""
    with path.open("rb+") as file:
        try:
            os.fsync(file.fileno())
        except OSError as error:
            # Some network shares do not support this.
            if error.errno not in _NOT_OFFERED:
                raise
