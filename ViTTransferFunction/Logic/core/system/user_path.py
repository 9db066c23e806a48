"""Paths as users write them."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError
from .regular_file import mode_of


def user_path(text: str | Path, what: str) -> Path:
    """A path whose `~` is spelled out, and that can be looked up; whether anything is there is for the caller to see.

    Quotes around it are left out, in which Windows' *Copy as path* puts paths.

    Args:
        text: as the user wrote it.
        what: what the user named by it, as the message calls it.

    Raises:
        InputError: there is no such home folder, or nothing could be found under this name.
    """
    try:
        path = Path(_unquoted(str(text))).expanduser()
    except RuntimeError as error:
        raise InputError(f"{text} cannot be {what}: there is no such home folder. Write the whole path.") from error
    mode_of(path)
    return path


def is_there(text: str | Path) -> bool:
    """Whether there is something at a path as users write it; False as well if it cannot be looked up."""
    try:
        return user_path(text, "a file or folder").exists()
    except InputError:
        return False


def _unquoted(text: str) -> str:
    return text[1:-1] if len(text) > 2 and text[0] == text[-1] and text[0] in "\"'" else text
