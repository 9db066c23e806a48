"""Files that are there whole or not at all: written beside their place, flushed to the disk, then renamed into it."""

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
"""No room: on the disk, in what this file may take, or in what this user may (which Windows does not know)."""

_NOT_OFFERED = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""What some network shares say of what they do not know."""

_LONGEST_ENDING = 16

TEMPORARY = ".writing-"
"""How names of temporary files begin."""

_TEMPORARY_NAME = re.compile(rf"{re.escape(TEMPORARY)}[0-9a-f]{{8}}(\..*)?")

ABANDONED_S = 24 * 3600.0
"""A file that was not changed for so long is written to by nobody, on this computer or on another that shares the folder."""

_SCANNERS_TAKE_S, _RETRY_S = 2.0, 0.05

_tidied: set[Path] = set()
"""Folders in which this process has looked for leftovers."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; on success it takes `path`'s place, on failure it is removed.

    The temporary file has the same ending as `path`, in lower case, since many writers choose their format by it. It takes its
    place only after the disk has it: what is reported as written is there after a power failure as well. What killed processes
    left in the folder goes, `ABANDONED_S` after they were.

    Raises:
        InputError: the folder cannot be written to, the disk is full, or `path` is a folder, a pipe or a device.
    """
    _check_replaceable(path)
    # Its name is known before there is a file, which is removed wherever an interruption comes.
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
        # Whatever ended the work is what the user should hear of.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def set_rights(path: Path, rights: int) -> None:
    """Set who may do what with a file or folder, where its disk lets the user: else it has the rights that the disk gives all.

    Of a Windows share that is mounted for everybody, all files belong to who mounted it, and nobody else may change that.
    """
    try:
        path.chmod(rights)
    except OSError as error:
        if not isinstance(error, PermissionError) and error.errno not in _NOT_OFFERED:
            raise


def check_writable(path: Path) -> None:
    """Raise InputError now if `path` could not be written later, before work is spent on its content. Leaves no trace."""
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
    """Windows makes such a folder under another name, without what its own ends in, and then does not find it."""
    for name in path.parent.parts:
        if name.endswith((" ", "..")) and name.strip(". "):
            raise InputError(
                f"Cannot write {path}: no folder's name may end in a space or in dots on Windows ({name!r}). Choose another."
            )


def _make_and_remove_file(folder: Path) -> None:
    if sys.platform == "win32":
        # Where nothing may be written, `tempfile` of Python 3.12 and before takes each name for taken, and tries 2**31 of them.
        flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_TEMPORARY
        os.close(os.open(_temporary(folder / "file"), flags, 0o600))
        return
    with tempfile.TemporaryFile(dir=folder):
        pass


def remove_leftovers(folder: Path, changed_before_s: float = math.inf) -> None:
    """Remove this user's temporary files from a folder: what killed processes left, as long as nobody is writing them now.

    Args:
        folder: where to look; nothing happens where that cannot be done.
        changed_before_s: the time before which they were changed last, in seconds since the epoch.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            # Many files may lie here: only those of our names are looked at.
            if _TEMPORARY_NAME.fullmatch(path.name):
                _remove_leftover(path, changed_before_s)


def _remove_leftover(path: Path, changed_before_s: float) -> None:
    with suppress(OSError):
        status = path.lstat()
        ours = not hasattr(os, "getuid") or status.st_uid == os.getuid()
        if ours and stat.S_ISREG(status.st_mode) and status.st_mtime < changed_before_s:
            path.unlink()


def _put_in_place(temporary: Path, path: Path) -> None:
    """Rename. Windows refuses that while another program has either file open: a virus scanner looks at whatever is new."""
    give_up = time.monotonic() + _SCANNERS_TAKE_S
    while sys.platform == "win32" and time.monotonic() < give_up:
        with suppress(PermissionError):
            temporary.replace(path)
            return
        time.sleep(_RETRY_S)
    temporary.replace(path)


def _tidy(folder: Path) -> None:
    """Remove what was left here long ago; once a folder, as listing one that many results are written to takes time."""
    if folder not in _tidied:
        _tidied.add(folder)
        remove_leftovers(folder, time.time() - ABANDONED_S)


def _cannot_write(path: Path, error: OSError) -> InputError:
    """The error for a file that the operating system did not take."""
    if error.errno in _FULL:
        return InputError(
            f"Cannot write {path}: the disk is full, or your share of it. Free some space or choose another folder."
        )
    advice = "Choose a folder that you can write to."
    if sys.platform == "win32" and isinstance(error, PermissionError):
        advice = "Close other programs that have it open, or choose a folder that you can write to."
    return InputError(f"Cannot write {path}: {error.strerror or error}. {advice}")


def _check_replaceable(path: Path) -> None:
    """A rename would put a file in the place of a device, and fail late where a folder is."""
    if sys.platform == "win32" and ":" in path.name:
        # It is found out late: what follows a colon is the name of a part of the file.
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
        # Renaming would get round the protection, and on Windows fail.
        raise InputError(f"Cannot write {path}: the file is write-protected. Choose another name.")


def _temporary(path: Path) -> Path:
    """Where to write what is to take a path's place."""
    return path.parent / f"{TEMPORARY}{secrets.token_hex(4)}{_ending(path)}"


def _ending(path: Path) -> str:
    """The last two suffixes, such as `.nii.gz`; cut, as the temporary file's name is longer than the file's."""
    return "".join(path.suffixes[-2:]).lower()[-_LONGEST_ENDING:]


def _make(temporary: Path) -> int:
    """Make a file that only its owner may read while it is being written; returns the rights that new files have here."""
    descriptor = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    try:
        # The file tells them. Python can look at the umask only by changing it, which other threads' files would have.
        rights = stat.S_IMODE(os.fstat(descriptor).st_mode)
        set_rights(temporary, 0o600)
    finally:
        os.close(descriptor)
    return rights


def _flush(path: Path) -> None:
    """Have the disk take the file. Some file systems notice only now that there is no room."""
    with path.open("rb+") as file:
        try:
            os.fsync(file.fileno())
        except OSError as error:
            # Some network shares cannot be asked.
            if error.errno not in _NOT_OFFERED:
                raise
