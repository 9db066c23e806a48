"""A film of a view in 3D, once around what it looks at, shot a frame at a time while the application goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import slicer

from ...core.system.progress import WorkProgress
from ...core.volumes.camera import Camera, Size
from ...core.volumes.stepped_work import Steps
from .preview_points import without_previews
from .view_picture import camera_of, view_picture

FRAMES_PER_SECOND = 12
"""Of films made in front ends."""


class Filming:
    """A film that is being shot.

    Args:
        scene: what the view shows.
        window: the vtkRenderWindow of the view.
        size: of the frames.
        frames: how many.
        drawings: how many pictures are asked for in all.
        film: makes the work from what draws a frame by its number (`files.film.film_steps`).
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        window: Any,
        size: Size,
        frames: int,
        drawings: int,
        film: Callable[[Callable[[int], np.ndarray]], Steps[None]],
    ) -> None:
        self._scene, self._window = scene, window
        self._size, self._frames, self._drawings = size, frames, drawings
        self._from: Camera = camera_of(window, size)
        self._steps = film(self._frame)
        self._done = 0

    @property
    def progress(self) -> WorkProgress:
        """How far it is."""
        return WorkProgress(min(self._done, self._drawings), self._drawings, "Filming", None)

    def advance(self) -> bool:
        """Shoot a frame, or let those that were shot be written; returns whether the film is finished.

        Raises:
            InputError: it cannot be written; that is then over.
        """
        try:
            self._done += next(self._steps)
        except StopIteration:
            return True
        return False

    def cancel(self) -> None:
        """Give the film up; nothing is left of it."""
        self._steps.close()

    def _frame(self, number: int) -> np.ndarray:
        # The user may be about to place a point.
        with without_previews(self._scene):
            return view_picture(self._window, self._size, camera=self._from.turned(360.0 * number / self._frames))
