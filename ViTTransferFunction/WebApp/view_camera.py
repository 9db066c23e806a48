"""From where the 3D view is seen, as a file: to see other cases alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..Logic.core.system.errors import InputError
from ..Logic.core.system.private_folder import private_folder
from ..Logic.core.volumes.camera import Size
from ..Logic.files.camera_files import read_camera, write_camera
from ..Logic.scene.session import SceneSession
from ..Logic.scene.views.view_picture import camera_of, see_by


def save_camera(session: SceneSession, window: Any, size: Size, path: Path) -> None:
    """Write from where a vtkRenderWindow is seen, for pictures of a size.

    Raises:
        InputError: nothing is in 3D that this could be relative to, or the file cannot be written.
    """
    write_camera(camera_of(window, size, session.views.middle_ras()), path)


def load_camera(session: SceneSession, window: Any, text: str) -> Size:
    """See a vtkRenderWindow from where a file says, which has this text; returns the size of its pictures. Nothing is drawn.

    Raises:
        InputError: nothing is in 3D that this could be relative to, or it is no camera.
    """
    middle = session.views.middle_ras()
    with private_folder() as folder:
        path = Path(folder, "camera.json")
        path.write_text(text, encoding="utf-8", errors="replace")
        try:
            camera = read_camera(path)
        except InputError as error:
            # The user has it in another folder, of which we do not know.
            raise InputError(str(error).replace(str(path), "The file")) from error
    see_by(window, camera, middle)
    return camera.size
