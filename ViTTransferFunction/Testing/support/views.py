"""Slicer's slice and 3D views without a screen, for tests that look at pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image

BACKGROUND_GRAY = 64
SLICE_PIXELS = 160
PIXELS_3D = 110
"""Few: software OpenGL takes its time over rays."""


class Views:
    """A volume, and views that show it when `pixels` asks.

    Attributes:
        scene: the MRML scene.
        app_logic: the application's logic.
        volume: a scalar volume node, equally grey everywhere, in the background of all slice views.
    """

    def __init__(
        self, slicer_app: Any, shape: tuple[int, int, int] = (32, 32, 32), ijk_to_ras: np.ndarray | None = None
    ) -> None:
        from trame_slicer.views import DirectViewFactory

        self._app = slicer_app
        self._app.view_manager.register_factory(DirectViewFactory(do_render_offscreen=True))
        self.scene = slicer_app.scene
        self.app_logic = slicer_app.app_logic
        self.volume = self.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
        set_image(self.volume, np.full(shape, BACKGROUND_GRAY, dtype=np.int16), np.eye(4) if ijk_to_ras is None else ijk_to_ras)
        self.volume.CreateDefaultDisplayNodes()
        self.volume.GetDisplayNode().SetAutoWindowLevel(False)
        self.volume.GetDisplayNode().SetWindowLevelMinMax(0.0, 255.0)

    def slice_view(self, orientation: str = "Axial") -> Any:
        """A new view on slices of the volume, all of which it fits."""
        from trame_slicer.views import ViewLayoutDefinition

        view = self._created(ViewLayoutDefinition.slice_view(orientation), SLICE_PIXELS)
        view.set_background_volume_id(self.volume.GetID())
        view.fit_view_to_content()
        return view

    def view_3d(self) -> Any:
        """A new view in 3D, of black background, from the front."""
        from trame_slicer.views import ViewLayoutDefinition

        return self._created(ViewLayoutDefinition.threed_view(background_color="#000000"), PIXELS_3D)

    def _created(self, definition: Any, size: int) -> Any:
        from trame_slicer.views.render_scheduler import NoScheduleRendering

        view = self._app.view_manager.create_view(definition)
        # Drawn when a test looks, not with every change.
        view.set_scheduled_render(NoScheduleRendering())
        view.render_window().SetSize(size, size)
        return view


def pixels(view: Any) -> np.ndarray:
    """What a view shows, (H, W, 3) uint8, the first row at the bottom."""
    view.render()
    grabber = vtk.vtkWindowToImageFilter()
    grabber.SetInput(view.render_window())
    grabber.ReadFrontBufferOff()
    grabber.ShouldRerenderOff()
    grabber.Update()
    columns, rows, _ = grabber.GetOutput().GetDimensions()
    return vtk_to_numpy(grabber.GetOutput().GetPointData().GetScalars()).reshape(rows, columns, -1)[..., :3].copy()


def slice_pixel(view: Any, ras: np.ndarray) -> tuple[int, int]:
    """Row and column where a slice view shows a point; the view is moved to its slice."""
    view.get_view_node().JumpSliceByOffsetting(*ras)
    to_xy = vtk.vtkMatrix4x4()
    vtk.vtkMatrix4x4.Invert(view.get_view_node().GetXYToRAS(), to_xy)
    x, y, _, _ = to_xy.MultiplyPoint((*ras, 1.0))
    return round(y), round(x)


def look_from(
    view: Any, centre_ras: np.ndarray, distance_mm: float, direction: tuple[float, float, float] = (0.0, 1.0, 0.0)
) -> None:
    """Point a 3D view's camera at a point."""
    camera = view.get_camera_node()
    camera.SetFocalPoint(*centre_ras)
    camera.SetPosition(*(np.asarray(centre_ras) + distance_mm * np.asarray(direction)))
    camera.SetViewUp(0.0, 0.0, 1.0)
    view.renderer().ResetCameraClippingRange()


def pixel_3d(view: Any, ras: np.ndarray) -> tuple[int, int]:
    """Row and column where a 3D view shows a point."""
    renderer = view.renderer()
    renderer.SetWorldPoint(*ras, 1.0)
    renderer.WorldToDisplay()
    x, y, _ = renderer.GetDisplayPoint()
    return round(y), round(x)


def drag(view: Any, point_ras: Any, button: str = "Left") -> None:
    """Move the mouse to where a view shows a point, press the button, move on, and release it."""
    interactor, (row, column) = view.interactor(), _point_at(view, point_ras)
    getattr(interactor, f"{button}ButtonPressEvent")()
    for step in range(1, 6):
        interactor.SetEventInformation(column + 3 * step, row + 2 * step)
        interactor.MouseMoveEvent()
    getattr(interactor, f"{button}ButtonReleaseEvent")()


def click(view: Any, point_ras: Any, shaking: bool = False, ctrl: bool = False, shift: bool = False) -> None:
    """Move the mouse to where a view shows a point, and click; `shaking`: it moves by a pixel while the button is held."""
    interactor, (row, column) = view.interactor(), _point_at(view, point_ras)
    interactor.SetEventInformation(column, row, int(ctrl), int(shift))
    interactor.LeftButtonPressEvent()
    if shaking:
        interactor.SetEventInformation(column + 1, row)
        interactor.MouseMoveEvent()
    interactor.LeftButtonReleaseEvent()


def _point_at(view: Any, point_ras: Any) -> tuple[int, int]:
    """Move the mouse to where a view shows a point; returns row and column."""
    find = pixel_3d if hasattr(view, "get_camera_node") else slice_pixel
    find(view, point_ras)
    for _ in range(2):  # Which points are seen, Slicer finds by the picture before.
        pixels(view)
    row, column = find(view, point_ras)
    view.interactor().SetEventInformation(column, row)
    view.interactor().MouseMoveEvent()
    return row, column


def ball(shape: tuple[int, int, int], centre_kji: tuple[float, float, float], radius: float, width: float = 2.0) -> np.ndarray:
    """A map (K, J, I) float32: 0.5 on a sphere, 1 well within it, 0 well outside; `width` voxels from 0 to 1."""
    kji = np.indices(shape, dtype=np.float32)
    distance = np.sqrt(sum((axis - centre) ** 2 for axis, centre in zip(kji, centre_kji, strict=True)))
    return np.clip(0.5 + (radius - distance) / width, 0.0, 1.0).astype(np.float32)
