"""The user's cache folder: weights, computed features, and points that are not saved yet lie below it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from .atomic_file import set_rights
from .errors import InputError
from .user_path import user_path

CACHE_VARIABLE = "VITTF_CACHE"
"""Environment variable that moves the cache elsewhere, to a larger disk say."""


def cache_folder() -> Path:
    """Root of the cache: `VITTF_CACHE`, or the platform's folder for a user's caches. It need not exist yet.

    Raises:
        InputError: there can be no such folder.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    try:
        if chosen:
            return user_path(chosen, f"the cache folder ({CACHE_VARIABLE})").absolute()
        return _user_cache_folder() / "vit-transfer-function"
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"There is no folder for the cache ({error}). Set the environment variable {CACHE_VARIABLE} to the path of one."
        ) from error


def make_private(folder: Path) -> None:
    """Make a folder that nobody but the user can look into. Raises OSError."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    # It may have been there already; where it is somebody else's, that is theirs to decide.
    set_rights(folder, 0o700)


def _user_cache_folder() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
