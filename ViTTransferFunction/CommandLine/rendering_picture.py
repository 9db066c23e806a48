"""A picture of segments in 3D, by GPU volume rendering: each segment a surface in its colour and opacity.

What is rendered is what Slicer's 3D views show of such classes: one volume for all of them (`mask_volume`), with the
same shader and light. Without a GPU, software OpenGL (Mesa) draws the same picture in some seconds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  (importing it gives VTK its OpenGL classes)
from scipy.ndimage import binary_dilation, label
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkRenderingCore import (
    vtkCamera,
    vtkLight,
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)

from ViTTransferFunction.CommandLine.canvas import (
    BACKGROUND,
    Canvas,
    PictureSegment,
    check_segments,
    draw_legend,
    legend_height,
)
from ViTTransferFunction.CommandLine.structure_prop import structure_prop
from ViTTransferFunction.Logic.core.colors import Color
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.composition import DEPTH, SURFACE
from ViTTransferFunction.Logic.rendering.intensity_levels import intensity_levels
from ViTTransferFunction.Logic.rendering.mask_volume import mask_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume, structure_volume

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
    looks = [Appearance(segment.color, segment.opacity) for segment in shown]
    rendered = _render(_structures_of(volume, shown), looks, height) if shown else _nothing_to_show(height)

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


def _structures_of(volume: Volume, segments: Sequence[PictureSegment]) -> StructureVolume:
    """The segments as a volume of structures."""
    voxels, grid = mask_volume(
        volume.geometry,
        [segment.mask for segment in segments],
        [segment.opacity for segment in segments],
        [
            None if segment.similarity is None or segment.iso is None else (segment.similarity, segment.iso)
            for segment in segments
        ],
    )
    return structure_volume(voxels, len(segments), intensity_levels(volume), grid, volume)


def _render(structures: StructureVolume, looks: Sequence[Appearance], height: int) -> np.ndarray:
    """Pixels (height, W, 3) uint8 of a volume of structures, framed by what it holds."""
    camera, width = framing(structures.voxels, structures.geometry, height)
    renderer = vtkRenderer()
    renderer.SetBackground(*BACKGROUND)
    renderer.SetBackground2(*BACKGROUND_ABOVE)
    renderer.GradientBackgroundOn()
    renderer.SetActiveCamera(camera)
    renderer.AddVolume(structure_prop(structures, looks))
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


def framing(voxels: np.ndarray, grid: Geometry, height: int) -> tuple[vtkCamera, int]:
    """A camera in front of and slightly above the patient that sees all of the volume, and the picture's width for it."""
    elevation = np.radians(ELEVATION_DEGREES)
    towards = np.array([0.0, np.cos(elevation), np.sin(elevation)])
    up = np.array([0.0, -np.sin(elevation), np.cos(elevation)])
    # Some of the voxels will do to know how far they reach.
    step = 1 + max(grid.shape) // 100
    seen_ijk = step * np.argwhere(voxels[::step, ::step, ::step, DEPTH] > SURFACE)[:, ::-1]
    if not len(seen_ijk):
        # Everything is transparent.
        seen_ijk = np.array([np.zeros(3), grid.shape[::-1]])
    seen = grid.ijk_to_ras_points(seen_ijk)
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    seen -= middle
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


def _add_lights(renderer: vtkRenderer) -> None:
    """A warm key light from the upper left, a cool fill from the right, a faint one from below; they move with the camera."""
    renderer.AutomaticLightCreationOff()
    for position, intensity, color in (
        ((-0.5, 0.7, 1.0), 1.3, (1.0, 0.98, 0.95)),
        ((0.9, 0.1, 0.6), 0.5, (0.88, 0.93, 1.0)),
        ((0.0, -0.7, 0.4), 0.2, (1.0, 1.0, 1.0)),
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
