"""Folders for files that are on their way between browser and scene."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

from ..Logic.core.errors import InputError


class PrivateFolder(tempfile.TemporaryDirectory[str]):
    """A new folder that only the user can enter; it goes with all that is in it, at the latest when the app ends."""

    def __init__(self) -> None:
        super().__init__(prefix="vittf-", ignore_cleanup_errors=True)

    def cleanup(self) -> None:
        """Remove it."""
        super().cleanup()
        # Windows removes no file that is open still, since it is being sent or compressed, say.
        if Path(self.name).exists():
            atexit.register(shutil.rmtree, self.name, ignore_errors=True)


def private_folder() -> PrivateFolder:
    """Make one.

    Raises:
        InputError: it cannot be made: the disk is full, say.
    """
    try:
        return PrivateFolder()
    except OSError as error:
        raise InputError(
            f"No temporary files can be kept: {error.strerror or error}. Make room on the disk for them, or have the variable "
            "TMPDIR name another folder and start the app again."
        ) from error
