"""What a view in 3D shows, as a picture of any size: of Slicer's own views, and of windows without a screen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkCamera, vtkRenderer, vtkWindowToImageFilter

from ...core.volumes.camera import Camera, Size, vector
from .quick_pictures import in_full

ORIGIN = np.zeros(3)


def view_picture(window: Any, size: Size, *, transparent: bool = False, camera: Camera | None = None) -> np.ndarray:
    """What a view shows, drawn anew in another size. The view is afterwards as it was.

    Args:
        window: the vtkRenderWindow of the view; its first renderer has what is shown.
        size: of the picture.
        transparent: whether there is nothing behind what is shown.
        camera: to see it by, relative to the origin; None: the view's own.

    Returns:
        The picture (H, W, 3) uint8, or (H, W, 4) with opacities where `transparent`.
    """
    renderer = window.GetRenderers().GetFirstRenderer()
    with _as_it_was(window, renderer), in_full(renderer):
        # Not on the screen: what is drawn stays in the buffer that is read.
        window.SwapBuffersOff()
        if camera is not None:
            place(renderer.GetActiveCamera(), camera, ORIGIN)
        if transparent:
            window.SetAlphaBitPlanes(1)
            renderer.SetGradientBackground(False)
            renderer.SetBackground(0.0, 0.0, 0.0)
            renderer.SetBackgroundAlpha(0.0)
        window.SetSize(*size)
        renderer.ResetCameraClippingRange()
        window.Render()
        return pixels_of(window, transparent)


def pixels_of(window: Any, transparent: bool = False) -> np.ndarray:
    """What was drawn in a vtkRenderWindow last: (H, W, 3) uint8, or (H, W, 4) with the opacity of each pixel."""
    grabber = vtkWindowToImageFilter()
    grabber.SetInput(window)
    if transparent:
        grabber.SetInputBufferTypeToRGBA()
    grabber.ReadFrontBufferOff()
    grabber.ShouldRerenderOff()
    grabber.Update()
    image = grabber.GetOutput()
    width, height, _ = image.GetDimensions()
    pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1].copy()
    return _straight(pixels) if transparent else pixels


def placed_camera(camera: Camera, middle_ras: np.ndarray) -> vtkCamera:
    """A camera as VTK has it, where the middle of what it sees, (3,), is at `middle_ras`."""
    made = vtkCamera()
    place(made, camera, middle_ras)
    return made


def place(seen_by: vtkCamera, camera: Camera, middle_ras: np.ndarray) -> None:
    """Bring VTK's camera to where a camera says."""
    seen_by.SetViewAngle(camera.view_angle_degrees)
    seen_by.SetPosition(*(middle_ras + np.array(camera.position_mm)))
    seen_by.SetFocalPoint(*(middle_ras + np.array(camera.focal_point_mm)))
    seen_by.SetViewUp(*camera.view_up)
    # Of views in parallel projection: as much is seen.
    seen_by.SetParallelScale(seen_by.GetDistance() * np.tan(np.radians(camera.view_angle_degrees / 2.0)))


def camera_of(window: Any, size: Size, middle_ras: np.ndarray = ORIGIN) -> Camera:
    """The camera that a view is seen by, for pictures of `size`, relative to the middle (3,) of what it sees."""
    seen_by = window.GetRenderers().GetFirstRenderer().GetActiveCamera()
    position, focal_point = np.array(seen_by.GetPosition()), np.array(seen_by.GetFocalPoint())
    if seen_by.GetParallelProjection():
        distance = seen_by.GetParallelScale() / np.tan(np.radians(seen_by.GetViewAngle() / 2.0))
        position = focal_point - distance * np.array(seen_by.GetDirectionOfProjection())
    return Camera(
        vector(position - middle_ras), vector(focal_point - middle_ras), seen_by.GetViewUp(), size, seen_by.GetViewAngle()
    )


def see_by(window: Any, camera: Camera, middle_ras: np.ndarray) -> None:
    """Have a view seen by what `camera_of` returned of it, or of another one; nothing is drawn."""
    renderer = window.GetRenderers().GetFirstRenderer()
    place(renderer.GetActiveCamera(), camera, middle_ras)
    renderer.ResetCameraClippingRange()


def _straight(pixels: np.ndarray) -> np.ndarray:
    """Pixels (H, W, 4) whose colours VTK weighed by their opacity, with the colours themselves, as PNG has them."""
    opacity = pixels[..., 3:].astype(np.float32) / 255.0
    colors = np.divide(pixels[..., :3], opacity, out=np.zeros(pixels[..., :3].shape, np.float32), where=opacity > 0.0)
    return np.concatenate([np.rint(np.minimum(colors, 255.0)).astype(np.uint8), pixels[..., 3:]], axis=-1)


@contextmanager
def _as_it_was(window: Any, renderer: vtkRenderer) -> Iterator[None]:
    """Undo what happens to a view, and draw it again."""
    camera, before = renderer.GetActiveCamera(), vtkCamera()
    # The camera itself is moved, and not another one put in its place: what goes with it, such as the cube that shows the
    # patient's directions, follows.
    before.DeepCopy(camera)
    size, swap, planes = tuple(window.GetSize()), window.GetSwapBuffers(), window.GetAlphaBitPlanes()
    gradient, color, alpha = renderer.GetGradientBackground(), renderer.GetBackground(), renderer.GetBackgroundAlpha()
    try:
        yield
    finally:
        camera.DeepCopy(before)
        renderer.SetGradientBackground(gradient)
        renderer.SetBackground(*color)
        renderer.SetBackgroundAlpha(alpha)
        window.SetAlphaBitPlanes(planes)
        window.SetSwapBuffers(swap)
        window.SetSize(*size)
        window.Render()
