"""Paths as users write them."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError


def user_path(text: str | Path, what: str) -> Path:
    """A path whose `~` is spelled out. Whether anything is there is for the caller to see, but that can be asked.

    Args:
        text: as the user wrote it.
        what: what the user named by it, as the message calls it.

    Raises:
        InputError: there is no such home folder, or no file could have this name.
    """
    try:
        path = Path(text).expanduser()
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return path
    except (OSError, RuntimeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{str(text)[:200]!r} cannot be {what}: {reason}. Check the path.") from error
    return path
