"""What may be opened: ordinary files. A pipe makes its reader wait for ever, and a device may never end."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

from .errors import InputError

LONGEST_ON_WINDOWS = 259
"""Characters of a path that Windows opens, unless it and the program were told to take longer ones."""
_OF_ANY_LENGTH = "\\\\?\\"
"""How paths begin that Windows takes as they are."""


def check_regular_file(path: Path) -> None:
    """Raise InputError unless there is an ordinary file at `path`, or a link to one."""
    mode = mode_of(path)
    if mode is None:
        raise InputError(f"There is no file {path}. Check the path.")
    if stat.S_ISDIR(mode):
        raise InputError(f"{path} is a folder; name a file.")
    if not stat.S_ISREG(mode):
        raise not_regular(path)


def is_folder(path: Path) -> bool:
    """Whether there is a folder at `path`. Raises InputError where that cannot be found out."""
    return stat.S_ISDIR(mode_of(path) or 0)


def mode_of(path: Path) -> int | None:
    """The `st_mode` of what is at `path`, links followed; None where nothing is.

    Raises:
        InputError: it cannot be found out: the name is too long, links lead in a circle, a folder may not be entered. Or the
            name is no text, which ITK ends the program at.
    """
    check_length(path)
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise InputError(
            f"{str(path)!a}: this name holds bytes that are no text (UTF-8). Rename the file or folder."
        ) from error
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise InputError(f"Cannot open {str(path)[:200]}: {error.strerror or error}. Check the path.") from error
    except ValueError as error:
        raise InputError(f"{str(path)[:200]!r} is no path: {error}.") from error


def check_length(path: Path, further: int = 0) -> None:
    """Raise InputError where Windows would say of a path that nothing is there, since it is too long.

    Args:
        path: of a file or folder, which need not be there.
        further: characters by which another name in its folder is longer that is needed as well.
    """
    if sys.platform != "win32" or str(path).startswith(_OF_ANY_LENGTH):
        return
    length = len(str(path.absolute())) + further
    if length > LONGEST_ON_WINDOWS and not _long_paths_are_enabled():
        raise InputError(
            f"{str(path)[:200]} is too long a path for this Windows: {length} characters, and {LONGEST_ON_WINDOWS} are the "
            "most that it opens. Use a folder with a shorter path, C:\\scans say."
        )


def _long_paths_are_enabled() -> bool:
    import ctypes

    # Windows 8 has no such function, and no such paths.
    enabled = getattr(ctypes.windll.ntdll, "RtlAreLongPathsEnabled", None)  # type: ignore[attr-defined,unused-ignore]
    if enabled is None:
        return False
    # A byte; what lies beside it in a larger number may be anything.
    enabled.restype = ctypes.c_ubyte
    return bool(enabled())


def not_regular(path: Path) -> InputError:
    """The error for what is neither file nor folder."""
    return InputError(f"{path} is a pipe, a device or a socket; expected an ordinary file.")


def cannot_read(path: Path, error: OSError) -> InputError:
    """The error for a file that the operating system does not let be read."""
    return InputError(f"Cannot read {path}: {error.strerror or error}.")
