"""Folders for files that are on their way between browser and scene."""

from __future__ import annotations

import tempfile

from ..Logic.core.errors import InputError


def private_folder() -> tempfile.TemporaryDirectory[str]:
    """A new folder that only the user can enter; it goes with all that is in it.

    Raises:
        InputError: it cannot be made: the disk is full, say.
    """
    try:
        return tempfile.TemporaryDirectory(prefix="vittf-", ignore_cleanup_errors=True)
    except OSError as error:
        raise InputError(
            f"No temporary files can be kept: {error.strerror or error}. Make room on the disk for them, or have the variable "
            "TMPDIR name another folder and start the app again."
        ) from error
