"""Points in annotation files: from the app to `vittf segment` and `vittf cohort`, and back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..Logic.core.system.errors import InputError
from ..Logic.files.annotation_files import read_annotations, write_annotations

if TYPE_CHECKING:
    from ..Logic.scene.session import SceneSession

POINTS_ENDING = ".json"
"""Files in DICOM folders are called `annotations.json`, others `scan.annotations.json`."""


def are_points(paths: Sequence[Path]) -> bool:
    """Whether it is a file of points that is to be opened, by its name. Such a file is opened by itself."""
    return len(paths) == 1 and paths[0].name.lower().endswith(POINTS_ENDING)


def save_points(session: SceneSession, path: Path) -> None:
    """Write the structures of a session with their points.

    Raises:
        InputError: there is none to write, two have one name, or the file cannot be written.
    """
    write_annotations(session.file_classes.annotated(), path)


def add_points(session: SceneSession, path: Path) -> None:
    """Add the structures of a file to a session; one step for undo.

    Raises:
        InputError: no scan is open, it is no annotation file, or it is one of another scan.
    """
    geometry = session.file_classes.geometry
    try:
        annotated = read_annotations(path, geometry)
    except InputError as error:
        # The user has it in another folder, of which we do not know.
        raise InputError(str(error).replace(str(path), path.name)) from error
    session.file_classes.add(annotated)
