"""Pictures and films of a 3D view, and its camera in files, so that several cases are seen alike."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.file_names import kept_name, with_ending
from ViTTransferFunction.Logic.core.volumes.camera import Size
from ViTTransferFunction.Logic.files.camera_files import read_camera, write_camera
from ViTTransferFunction.Logic.files.film import FilmPlan, check_film_writer, film_steps
from ViTTransferFunction.Logic.scene.views.filming import FRAMES_PER_SECOND, Filming
from ViTTransferFunction.Logic.scene.views.png_file import save_png
from ViTTransferFunction.Logic.scene.views.view_picture import camera_of, see_by, view_picture
from ViTTransferFunction.Widget.progress_row import ProgressRow
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.views import view_windows


class PicturesSection(Section):
    """Size and kind of pictures, the buttons that make them, and a film's progress."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._filming: Filming | None = None
        self._progress = ProgressRow(ui, "film")
        self._timer = qt.QTimer()
        # Whenever the application has nothing else to do.
        self._timer.interval = 0
        self._timer.timeout.connect(self._on_timer)
        ui.pictureButton.clicked.connect(lambda: self.attempt(self._take_picture))
        ui.filmButton.clicked.connect(lambda: self.attempt(self._start_film))
        ui.saveCameraButton.clicked.connect(lambda: self.attempt(self._save_camera))
        ui.loadCameraButton.clicked.connect(lambda: self.attempt(self._load_camera))
        self._progress.cancel_button.clicked.connect(self._end_film)

    def refresh(self) -> None:
        """Show what can be done, and how far a film is; a film ends with the session."""
        if self.session is None:
            self._end_film()
        self._progress.show(self._filming.progress if self._filming else None)
        for button in (self.ui.pictureButton, self.ui.filmButton, self.ui.saveCameraButton, self.ui.loadCameraButton):
            button.enabled = self.session is not None and self._filming is None

    def _take_picture(self) -> None:
        path = self._asked_for_path(_("Save picture"), (".png",), _("Pictures") + " (*.png)")
        if path is not None:
            transparent = self.ui.pictureTransparentCheckBox.checked
            save_png(view_picture(view_window(), self._size(), transparent=transparent), path)

    def _start_film(self) -> None:
        path = self._asked_for_path(_("Save film"), (".gif", ".mp4"), _("Films") + " (*.gif *.mp4)")
        if path is None:
            return
        seconds = self.ui.filmSecondsSpinBox.value
        plan = FilmPlan(path, round(FRAMES_PER_SECOND * seconds), seconds)
        check_film_writer(path)
        self._filming = Filming(
            slicer.mrmlScene, view_window(), self._size(), plan.frames, plan.drawings, lambda frame: film_steps(plan, frame)
        )
        self._timer.start()

    def _on_timer(self) -> None:
        if self._filming is not None:
            self.attempt(self._shoot)

    def _shoot(self) -> None:
        assert self._filming is not None
        try:
            over = self._filming.advance()
        except InputError:
            self._end_film()
            raise
        if over:
            self._end_film()

    def _end_film(self) -> None:
        """Let go of the film; of one that is not finished, nothing is left."""
        filming, self._filming = self._filming, None
        self._timer.stop()
        if filming is not None:
            filming.cancel()
            self.refresh()

    def _save_camera(self) -> None:
        assert self.session is not None
        middle = self.session.views.middle_ras()
        path = self._asked_for_path(_("Save camera"), (".json",), _("Cameras") + " (*.json)")
        if path is not None:
            write_camera(camera_of(view_window(), self._size(), middle), path)

    def _load_camera(self) -> None:
        assert self.session is not None
        middle = self.session.views.middle_ras()
        path = ask_path_to_read(_("Load camera"), _("Cameras") + " (*.json)", self.ui.loadCameraButton)
        if not path:
            return
        camera = read_camera(Path(path))
        window = view_window()
        see_by(window, camera, middle)
        self.ui.pictureWidthSpinBox.value, self.ui.pictureHeightSpinBox.value = camera.size
        window.Render()

    def _size(self) -> Size:
        return self.ui.pictureWidthSpinBox.value, self.ui.pictureHeightSpinBox.value

    def _asked_for_path(self, title: str, endings: Sequence[str], kinds: str) -> Path | None:
        """Where the user wants a file, with one of the `endings`; None where they cancel."""
        volume = self.session.parameters.volume if self.session else None
        name = kept_name((volume.GetName() if volume else "") or "ViTTransferFunction") + endings[0]
        chosen = ask_path_to_write(title, name, kinds, self.ui.pictureButton)
        return with_ending(Path(chosen), endings) if chosen else None


def view_window() -> Any:
    """The vtkRenderWindow of the first 3D view that is shown.

    Raises:
        InputError: none is.
    """
    shown = view_windows()
    if not shown:
        raise InputError(_("No 3D view is shown. Choose a layout that has one, by View, Layout."))
    return shown[0]


def ask_path_to_write(title: str, name: str, kinds: str, parent: Any) -> str:
    """Have the user choose a file to write, `name` unless they say otherwise; "" where they cancel."""
    return str(qt.QFileDialog.getSaveFileName(parent, title, _in_start_folder(name), kinds))


def ask_path_to_read(title: str, kinds: str, parent: Any) -> str:
    """Have the user choose a file to read; "" where they cancel."""
    return str(qt.QFileDialog.getOpenFileName(parent, title, _in_start_folder(""), kinds))


def _in_start_folder(name: str) -> str:
    """The name of a file in the folder that a dialog begins in; "": the folder.

    Where Slicer is started by a click, on Windows and Macs, the working folder is its own, or the whole disk. The scene has the
    user's documents, or where it was saved to.
    """
    root = slicer.mrmlScene.GetRootDirectory()
    return Path(root, name).as_posix() if sys.platform in ("win32", "darwin") and root else name
