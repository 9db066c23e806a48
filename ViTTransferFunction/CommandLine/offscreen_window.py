"""Pixels of what VTK renders, without a screen: opaque over the pictures' background, or on none.

Without a GPU, software OpenGL (Mesa) draws the same picture in some seconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

import numpy as np
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (importing it gives VTK its OpenGL classes)
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkRenderingCore import vtkCamera, vtkRenderer, vtkRenderWindow

from ViTTransferFunction.CommandLine.canvas import BACKGROUND
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.camera import Size
from ViTTransferFunction.Logic.scene.views.view_picture import pixels_of

BACKGROUND_ABOVE: Color = (0.15, 0.17, 0.20)


class OffscreenWindow:
    """Takes pictures of what a renderer holds; to be used in a `with` statement, which gives the window back.

    Args:
        renderer: with volumes and lights.

    Raises:
        InputError: OpenGL is missing.
    """

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        renderer.SetBackground2(*BACKGROUND_ABOVE)
        with _vtk_warnings_off():
            # VTK tries one kind of window after the other, and warns of each that this machine does not have.
            self._window = vtkRenderWindow()
            self._window.SetOffScreenRendering(1)
            self._window.SetAlphaBitPlanes(1)
            # Without a context VTK does not fail but crashes, and only as it renders.
            self._window.Initialize()
            if not self._window.IsCurrent():
                raise InputError(
                    "The 3D picture needs OpenGL 3.2, and this machine offers none. Install a graphics driver or Mesa's "
                    "software OpenGL (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri), or do without the 3D picture."
                )
        self._window.AddRenderer(renderer)

    def __enter__(self) -> OffscreenWindow:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._window.Finalize()

    def picture(self, camera: vtkCamera, size: Size, *, transparent: bool = False) -> np.ndarray:
        """What the camera sees: (H, W, 3) uint8, or (H, W, 4) with the opacity of each pixel and nothing behind it."""
        self._renderer.SetGradientBackground(not transparent)
        self._renderer.SetBackground(*((0.0, 0.0, 0.0) if transparent else BACKGROUND))
        self._renderer.SetBackgroundAlpha(0.0 if transparent else 1.0)
        self._renderer.SetActiveCamera(camera)
        self._renderer.ResetCameraClippingRange()
        self._window.SetSize(*size)
        self._window.Render()
        return pixels_of(self._window, transparent)


@contextmanager
def _vtk_warnings_off() -> Iterator[None]:
    before = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(before)
