"""Files that are there whole or not at all: written beside their place, then renamed into it."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError

_TEMPORARY = ".writing-"
"""How names of temporary files begin."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; on success it takes `path`'s place, on failure it is removed.

    The temporary file has the same endings as `path`, since many writers choose their format by it.

    Raises:
        InputError: the folder cannot be written to, or the disk is full.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=_TEMPORARY, suffix="".join(path.suffixes))
        os.close(handle)
    except OSError as error:
        raise _cannot_write(path, error) from error
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files that only their owner may read; give this one the usual rights.
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: Path) -> None:
    """Raise InputError now if `path` could not be written later, before work is spent on its content. Leaves no trace."""
    if path.is_dir():
        raise InputError(f"Cannot write {path}: it is a folder; name a file.")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _cannot_write(path, error) from error


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of processes that were killed while they wrote to `folder`; nobody may be writing there now."""
    for path in folder.glob(f"{_TEMPORARY}*"):
        path.unlink(missing_ok=True)


def _cannot_write(path: Path, error: OSError) -> InputError:
    if error.errno == errno.ENOSPC:
        return InputError(f"Cannot write {path}: the disk is full. Free some space or choose another folder.")
    return InputError(f"Cannot write {path}: {error.strerror or error}. Choose a folder that you can write to.")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
