"""A picture of segments in 3D, by GPU volume rendering: each class an iso-surface in its colour and opacity.

All classes share one volume of colours (`classified_volume`), so there may be any number of them. Without a GPU, software
OpenGL (Mesa) draws the same picture in some seconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  (importing it gives VTK its OpenGL classes)
from scipy.ndimage import binary_dilation, label
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import (
    vtkCamera,
    vtkLight,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
    vtkWindowToImageFilter,
)
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

from ViTTransferFunction.CommandLine.canvas import (
    BACKGROUND,
    Canvas,
    Color,
    PictureSegment,
    check_segments,
    draw_legend,
    legend_height,
)
from ViTTransferFunction.CommandLine.classified_volume import ClassifiedVolume, classify, surface_opacity
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.volume import Volume

COARSEST_CONTEXT_MM = 5.0
"""With thicker slices, only crumbs of bone would be left of a skeleton."""

BONE_HU = 250.0
"""Where bone begins in CT: the usual `context_above`."""

CONTEXT_COLOR: Color = (0.93, 0.90, 0.82)
CONTEXT_OPACITY = 0.3
SMALLEST_CONTEXT_MM3 = 5000.0

BACKGROUND_ABOVE: Color = (0.15, 0.17, 0.20)
ELEVATION_DEGREES = 8.0
VIEW_ANGLE_DEGREES = 20.0
STEP_VOXELS = 0.9
"""Length of a ray's steps."""

CODE_COMPONENT = 3
"""The component of a classified volume that opacity is taken from."""


def render_3d(
    volume: Volume, segments: Sequence[PictureSegment], *, context_above: float | None = None, height: int = 1000
) -> np.ndarray:
    """Render segments in 3D, seen from the front and slightly above, patient's right on the left, with a legend.

    Args:
        volume: where the segments lie.
        segments: what to show. Those without voxels stay in the legend; if none has any, the picture says so.
        context_above: intensity above which the rest of the volume is faintly shown around the segments, `BONE_HU` for CT, say;
            None shows the segments alone, and so do volumes of thick slices.
        height: the picture's height in pixels, without the legend; its width follows from what is shown.

    Returns:
        The picture, (H, W, 3) uint8.

    Raises:
        InputError: OpenGL is missing.
        ValueError: a mask's shape is not the volume's.
    """
    check_segments(segments, volume.shape)
    shown = [segment for segment in segments if segment.mask.any()]
    if shown and context_above is not None and volume.geometry.spacing_mm.max() <= COARSEST_CONTEXT_MM:
        shown.append(_context(volume, shown, context_above))
    rendered = _render(classify(volume.geometry, shown), height) if shown else _nothing_to_show(height)

    text_size = max(10, round(0.02 * height))
    canvas = Canvas(rendered.shape[1], height + legend_height(segments, rendered.shape[1], text_size) + text_size)
    canvas.pixels[:height] = rendered / np.float32(255.0)
    if shown:
        _draw_letters(canvas, height, text_size)
    draw_legend(canvas, height + text_size // 2, segments, text_size)
    return canvas.picture()


def _context(volume: Volume, segments: Sequence[PictureSegment], threshold: float) -> PictureSegment:
    """What is brighter than `threshold` and belongs to no segment, small pieces left out; may be empty."""
    intensities = np.nan_to_num(volume.array.astype(np.float32), posinf=threshold)
    bright = intensities > threshold
    taken = np.logical_or.reduce([segment.mask for segment in segments])
    # A bright segment has a bright rim, which would wrap it in a shell.
    bright &= ~(taken | binary_dilation(taken & bright, iterations=2))
    pieces, _ = label(bright, structure=np.ones((3, 3, 3)))
    sizes_mm3 = np.bincount(pieces.ravel()) * volume.geometry.voxel_volume_mm3
    sizes_mm3[0] = 0.0
    mask = (sizes_mm3 >= SMALLEST_CONTEXT_MM3)[pieces]
    return PictureSegment("context", CONTEXT_COLOR, CONTEXT_OPACITY, mask, similarity=intensities, iso=threshold)


def _render(classified: ClassifiedVolume, height: int) -> np.ndarray:
    """Pixels (height, W, 3) uint8 of a classified volume, framed by what it holds."""
    camera, width = _camera(classified, height)
    renderer = vtkRenderer()
    renderer.SetBackground(*BACKGROUND)
    renderer.SetBackground2(*BACKGROUND_ABOVE)
    renderer.GradientBackgroundOn()
    renderer.SetActiveCamera(camera)
    renderer.AddVolume(_volume(classified))
    _add_lights(renderer)
    renderer.ResetCameraClippingRange()
    with _vtk_warnings_off():
        # VTK tries one kind of window after the other, and warns of each that this machine does not have.
        window = vtkRenderWindow()
        window.SetOffScreenRendering(1)
        window.SetSize(width, height)
        # Without a context VTK does not fail but crashes, and only as it renders.
        window.Initialize()
        if not window.IsCurrent():
            raise InputError(
                "The 3D picture needs OpenGL 3.2, and this machine offers none. Install a graphics driver or Mesa's software "
                "OpenGL (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri), or do without the 3D picture."
            )
    window.AddRenderer(renderer)
    window.Render()
    grabber = vtkWindowToImageFilter()
    grabber.SetInput(window)
    grabber.ReadFrontBufferOff()
    grabber.ShouldRerenderOff()
    grabber.Update()
    pixels = vtk_to_numpy(grabber.GetOutput().GetPointData().GetScalars()).reshape(height, width, 3)[::-1].copy()
    window.Finalize()
    return pixels


@contextmanager
def _vtk_warnings_off() -> Iterator[None]:
    before = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(before)


def _camera(classified: ClassifiedVolume, height: int) -> tuple[vtkCamera, int]:
    """A camera in front of and slightly above the patient that sees all of the volume, and the picture's width for it."""
    elevation = np.radians(ELEVATION_DEGREES)
    towards = np.array([0.0, np.cos(elevation), np.sin(elevation)])
    up = np.array([0.0, -np.sin(elevation), np.cos(elevation)])
    middle = (classified.origin_ras + classified.far_corner_ras) / 2
    # A few of the voxels that are seen will do to know how far they reach; ramps are wide enough not to be stepped over.
    seen = np.argwhere(classified.rgba[::4, ::4, ::4, CODE_COMPONENT] > 0)[:, ::-1] * 4 * classified.spacing_mm
    seen += classified.origin_ras - middle
    if not len(seen):
        # Everything is transparent.
        seen = (classified.far_corner_ras - middle)[None]
    across, along = abs(seen[:, 0]), abs(seen @ up)
    # Neither a strip nor a panorama.
    aspect = float(np.clip(across.max() / along.max(), 0.75, 1.6))
    margin = 1.05
    reach = margin * np.maximum(across / aspect, along) / np.tan(np.radians(VIEW_ANGLE_DEGREES / 2))
    camera = vtkCamera()
    camera.SetViewAngle(VIEW_ANGLE_DEGREES)
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle + (reach + seen @ towards).max() * towards))
    camera.SetViewUp(*up)
    return camera, round(aspect * height)


def _volume(classified: ClassifiedVolume) -> vtkVolume:
    image = vtkImageData()
    image.SetDimensions(*classified.rgba.shape[2::-1])
    image.SetOrigin(*classified.origin_ras)
    image.SetSpacing(*[classified.spacing_mm] * 3)
    image.GetPointData().SetScalars(numpy_to_vtk(classified.rgba.reshape(-1, 4), deep=True))
    mapper = vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(STEP_VOXELS * classified.spacing_mm)
    # Rays that start at random depths turn the rings that steps leave on translucent surfaces into faint grain.
    mapper.UseJitteringOn()
    # Else the tables span the codes that occur, and are then read as if they spanned all of 0 … 255.
    mapper.SetScalarOpacityRangeType(vtkGPUVolumeRayCastMapper.NATIVE)
    mapper.SetGradientOpacityRangeType(vtkGPUVolumeRayCastMapper.NATIVE)
    volume = vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(_material(classified))
    return volume


def _material(classified: ClassifiedVolume) -> vtkVolumeProperty:
    unit_mm = classified.ramp_mm / 4
    opacity = vtkPiecewiseFunction()
    for code, value in enumerate(surface_opacity(classified, unit_mm)):
        opacity.AddPoint(code, value)
    # Only where codes change is a surface; the inside of a translucent class is clear. In codes per voxel.
    edges = vtkPiecewiseFunction()
    for slope, value in ((0.0, 0.0), (1.5, 0.0), (5.0, 1.0), (255.0, 1.0)):
        edges.AddPoint(slope, value)
    material = vtkVolumeProperty()
    material.IndependentComponentsOff()
    material.SetInterpolationTypeToLinear()
    material.SetScalarOpacity(opacity)
    material.SetGradientOpacity(edges)
    # VTK takes the functions from component 0, their unit from the component that they are applied to.
    material.SetScalarOpacityUnitDistance(CODE_COMPONENT, unit_mm)
    material.ShadeOn()
    material.SetAmbient(0.32)
    material.SetDiffuse(0.85)
    material.SetSpecular(0.16)
    material.SetSpecularPower(22.0)
    return material


def _add_lights(renderer: vtkRenderer) -> None:
    """A warm key light from the upper left, a cool fill from the right, a faint one from below; they move with the camera."""
    renderer.AutomaticLightCreationOff()
    for position, intensity, color in (
        ((-0.5, 0.7, 1.0), 0.95, (1.0, 0.98, 0.95)),
        ((0.9, 0.1, 0.6), 0.35, (0.88, 0.93, 1.0)),
        ((0.0, -0.7, 0.4), 0.15, (1.0, 1.0, 1.0)),
    ):
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*position)
        light.SetFocalPoint(0.0, 0.0, 0.0)
        light.SetIntensity(intensity)
        light.SetColor(*color)
        renderer.AddLight(light)


def _nothing_to_show(height: int) -> np.ndarray:
    """A picture (height, height, 3) uint8 that explains why it is empty."""
    canvas = Canvas(height, height)
    canvas.text(height / 2, height / 2, "Nothing to show: no segment has any voxel", max(10, height // 36), anchor="center")
    return canvas.picture()


def _draw_letters(canvas: Canvas, height: int, text_size: int) -> None:
    """The patient's directions at the edges of the rendering."""
    width, margin = canvas.pixels.shape[1], 1.2 * text_size
    for x, y, letter in (
        (margin, height / 2, "R"),
        (width - margin, height / 2, "L"),
        (width / 2, margin, "S"),
        (width / 2, height - margin, "I"),
    ):
        canvas.label(x, y, letter, text_size, anchor="center")
