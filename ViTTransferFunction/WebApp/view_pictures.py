"""Pictures of the 3D view as files: drawn where the scene is, compressed where it does not matter how long that takes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..Logic.core.system.errors import InputError
from ..Logic.core.system.progress import Progress, no_progress
from ..Logic.core.volumes.camera import Size, checked_side
from ..Logic.scene.views.png_file import save_png
from ..Logic.scene.views.view_picture import view_picture
from .packing import COMPRESSING


def asked_size(width: Any, height: Any) -> Size:
    """The size of a picture that the page asks for.

    Raises:
        InputError: it is none.
    """
    wide, high = (checked_side(_whole(side), "The size of a picture") for side in (width, height))
    return wide, high


def stage_picture(window: Any, size: Size, transparent: bool, path: Path) -> None:
    """Draw what a vtkRenderWindow shows into a new file, of which `pack_picture` makes a PNG.

    Raises:
        InputError: the file cannot be written.
    """
    picture = view_picture(window, size, transparent=transparent)
    try:
        with path.open("xb") as file:
            np.save(file, picture, allow_pickle=False)
    except OSError as error:
        raise InputError("The picture could not be saved. Make room on the disk of temporary files, and try again.") from error


def pack_picture(raw: Path, path: Path, progress: Progress = no_progress) -> None:
    """Compress a picture that was staged; `progress` may raise to stop it."""
    progress(0, 1, COMPRESSING)
    save_png(np.load(raw, allow_pickle=False), path)


def _whole(side: Any) -> Any:
    """What a page or an address writes as a whole number, as one; anything else as it is."""
    return int(side) if str(side).isdecimal() and len(str(side)) < 10 else side
