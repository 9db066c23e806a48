"""Pictures of segments in 3D, by GPU volume rendering: each segment is a surface in its colour and opacity.

They look as in Slicer's 3D views: all segments are rendered as one volume (`mask_volume`), with the same shader and light.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

import numpy as np
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  (importing it gives VTK its OpenGL classes)
from scipy.ndimage import binary_dilation, label
from vtkmodules.vtkRenderingCore import vtkLight, vtkRenderer

from ViTTransferFunction.CommandLine.canvas import Canvas, PictureSegment, check_segments, draw_legend, legend_height
from ViTTransferFunction.CommandLine.offscreen_window import OffscreenWindow
from ViTTransferFunction.CommandLine.structure_prop import structure_prop
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.camera import (
    DEFAULT_DIRECTION,
    DEFAULT_HEIGHT,
    Camera,
    Direction,
    Size,
    framing,
    middle_of,
)
from ViTTransferFunction.Logic.core.volumes.intensity_window import looks_like_hounsfield_units
from ViTTransferFunction.Logic.core.volumes.patient_sides import nearest_side
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.rendering.appearance import DEFAULT_STYLE, Appearance
from ViTTransferFunction.Logic.rendering.composition import DEPTH, INTENSITY, MOST_STRUCTURES, SURFACE
from ViTTransferFunction.Logic.rendering.intensity_levels import intensity_levels
from ViTTransferFunction.Logic.rendering.mask_volume import mask_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume, structure_volume
from ViTTransferFunction.Logic.rendering.surroundings import CONTEXTS, Surroundings
from ViTTransferFunction.Logic.scene.views.view_picture import placed_camera

COARSEST_CONTEXT_MM = 5.0
"""With thicker slices, no context is shown, since only fragments of the skeleton would be visible."""

BONE_HU = 250.0
"""Lower threshold of bone in CT: the usual `context_above`."""

CONTEXT_COLOR: Color = (0.93, 0.90, 0.82)
CONTEXT_OPACITY = 0.3
SMALLEST_CONTEXT_MM3 = 5000.0
"""Smaller pieces of the context are left out; in a scan of a body, and less in small scans (`body_scale`)."""


def render_3d(
    volume: Volume, segments: Sequence[PictureSegment], *, context_above: float | None = None, height: int = DEFAULT_HEIGHT
) -> np.ndarray:
    """Render segments in 3D, seen from the front and slightly above, patient's right on the left, with a legend.

    Args:
        volume: the volume of the segments.
        segments: the segments to show. Those without voxels stay in the legend; if none has voxels, the picture says so.
        context_above: as for `Rendering`.
        height: the picture's height in pixels, without the legend; the width follows from the extent of the segments.

    Returns:
        The picture, (H, W, 3) uint8.

    Raises:
        InputError: OpenGL is not available.
        ValueError: a mask's shape is not the volume's.
    """
    check_segments(segments, volume.shape)
    if not any(segment.mask.any() for segment in segments):
        return with_legend(_nothing_to_show(height), segments)
    with Rendering(volume, segments, context_above=context_above) as rendering:
        return rendering.labelled_picture(rendering.framing(height=height))


class Rendering:
    """Segments in 3D, rendered from any camera; to be used in a `with` statement.

    Args:
        volume: the volume of the segments.
        segments: the segments to show; at least one of them has voxels.
        context_above: intensity above which the rest of the volume is faintly shown around the segments, such as `BONE_HU` for
            CT. None shows the segments alone, as do volumes with thick slices, and `MOST_STRUCTURES` segments with voxels.
        context: one of `CONTEXTS` to show around the segments instead; it is cut away where it hides them.
        style: style of the segments, one of `STYLES`.

    Attributes:
        middle_ras: middle of the segments (3,), RAS millimetres, which cameras refer to.

    Raises:
        InputError: OpenGL is not available.
    """

    def __init__(
        self,
        volume: Volume,
        segments: Sequence[PictureSegment],
        *,
        context_above: float | None = None,
        context: str | None = None,
        style: str = DEFAULT_STYLE,
    ) -> None:
        self._segments = segments
        shown = [segment for segment in segments if segment.mask.any()]
        self.middle_ras = middle_of(volume.geometry, [segment.mask for segment in shown])
        looks = [Appearance(segment.color, segment.opacity, style) for segment in shown]
        coarse = volume.geometry.spacing_mm.max() > COARSEST_CONTEXT_MM
        if context is None and context_above is not None and not coarse and len(shown) < MOST_STRUCTURES:
            shown.append(_context(volume, shown, context_above))
            looks.append(Appearance(CONTEXT_COLOR, CONTEXT_OPACITY))
        structures = _structures_of(volume, shown, whole=context is not None, scanned=style != DEFAULT_STYLE)
        around = Surroundings()
        if context is not None:
            around = Surroundings(CONTEXTS[context](structures.hounsfield, structures.levels), cutaway=1.0)
        self._reach_ras = _reach(structures, around)
        renderer = vtkRenderer()
        renderer.AddVolume(structure_prop(structures, looks, around))
        add_lights(renderer)
        self._window = OffscreenWindow(renderer)

    def __enter__(self) -> Rendering:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._window.__exit__(kind, error, trace)

    def framing(
        self,
        seen_from: Direction = DEFAULT_DIRECTION,
        *,
        height: int = DEFAULT_HEIGHT,
        size: Size | None = None,
        turning: bool = False,
    ) -> Camera:
        """A camera that sees everything that is shown; see `camera.framing` for the arguments."""
        return framing(self._reach_ras, self.middle_ras, seen_from, height=height, size=size, turning=turning)

    def picture(self, camera: Camera, *, transparent: bool = False) -> np.ndarray:
        """The picture that the camera sees, in its size: (H, W, 3) uint8, or (H, W, 4) with opacities if `transparent`."""
        return self._window.picture(placed_camera(camera, self.middle_ras), camera.size, transparent=transparent)

    def labelled_picture(self, camera: Camera, size: Size | None = None) -> np.ndarray:
        """The picture that the camera sees, with the patient's directions at its edges and a legend below: (H, W, 3) uint8.

        Args:
            camera: the camera, of the size of the picture without the legend.
            size: total size, at least `height_below` higher than the camera's; None: as high as needed.
        """
        canvas = Canvas(*camera.size)
        canvas.pixels[:] = self.picture(camera) / np.float32(255.0)
        _draw_letters(canvas, camera)
        return with_legend(canvas.picture(), self._segments, size)


def with_legend(picture: np.ndarray, segments: Sequence[PictureSegment], size: Size | None = None) -> np.ndarray:
    """A picture (H, W, 3) uint8 with the names and colours of the segments below; `size` is the total size."""
    height, width = picture.shape[:2]
    canvas = Canvas(*(size or (width, height + height_below(segments, (width, height)))))
    canvas.pixels[:height] = picture / np.float32(255.0)
    letters = text_size(height)
    draw_legend(canvas, height + letters // 2, segments, letters)
    return canvas.picture()


def height_below(segments: Sequence[PictureSegment], size: Size) -> int:
    """Height in pixels that `with_legend` adds to a picture of `size`; no less than it adds to a lower picture."""
    return legend_height(segments, size[0], text_size(size[1])) + text_size(size[1])


def text_size(height: int) -> int:
    """Size of the letters in a picture of `height` pixels."""
    return max(10, round(0.02 * height))


def _context(volume: Volume, segments: Sequence[PictureSegment], threshold: float) -> PictureSegment:
    """The context: voxels above `threshold` that belong to no segment, without small pieces; may be empty."""
    intensities = np.nan_to_num(volume.array.astype(np.float32), copy=False, posinf=threshold)
    bright = intensities > threshold
    taken = np.logical_or.reduce([segment.mask for segment in segments])
    # A bright segment has a bright rim, which would enclose it like a shell.
    bright &= ~(taken | binary_dilation(taken & bright, iterations=2))
    pieces, count = label(bright, structure=np.ones((3, 3, 3)))
    sizes = np.zeros(count + 1, dtype=int)
    for of_slice in pieces:  # For all at once, bincount would make a copy of eight bytes per voxel.
        sizes += np.bincount(of_slice.ravel(), minlength=count + 1)
    large = sizes * volume.geometry.voxel_volume_mm3 >= volume.geometry.body_scale**3 * SMALLEST_CONTEXT_MM3
    large[0] = False
    mask = large[pieces]
    return PictureSegment("context", CONTEXT_COLOR, CONTEXT_OPACITY, mask, similarity=intensities, iso=threshold)


def _structures_of(volume: Volume, segments: Sequence[PictureSegment], whole: bool, scanned: bool) -> StructureVolume:
    """The segments as a volume of structures.

    Args:
        volume: the volume of the segments.
        segments: the segments.
        whole: whether to include the whole volume instead of only the part that holds the segments.
        scanned: whether the segments' style needs the volume's intensities.
    """
    levels = intensity_levels(volume)
    voxels, grid = mask_volume(
        volume.geometry,
        [segment.mask for segment in segments],
        [segment.opacity for segment in segments],
        [
            None if segment.similarity is None or segment.iso is None else (segment.similarity, segment.iso)
            for segment in segments
        ],
        (volume.array, levels) if whole or scanned else None,
        whole,
    )
    hounsfield = looks_like_hounsfield_units(volume)
    return structure_volume(voxels, len(segments), levels, grid, volume.geometry, hounsfield=hounsfield)


def _reach(structures: StructureVolume, around: Surroundings) -> np.ndarray:
    """Positions of visible voxels of a volume of structures, (N, 3) RAS millimetres."""
    voxels, grid = structures.voxels, structures.geometry
    # A subset of the voxels is enough to find their extent.
    step = 1 + max(grid.shape) // 100
    some = voxels[::step, ::step, ::step]
    densities = around.colors(structures.levels, structures.unit_voxels)[:, 3]
    shown = (some[..., DEPTH] > SURFACE) | (densities > 0.0)[some[..., INTENSITY].astype(int) * (len(densities) - 1) // 255]
    seen_ijk = step * np.argwhere(shown)[:, ::-1]
    if not len(seen_ijk):
        # Everything is transparent.
        seen_ijk = np.array([np.zeros(3), grid.shape[::-1]])
    return grid.ijk_to_ras_points(seen_ijk)


def add_lights(renderer: vtkRenderer) -> None:
    """Add lights that move with the camera: a warm key light at the upper left, a cool fill at the right, a faint one below."""
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


def _draw_letters(canvas: Canvas, camera: Camera) -> None:
    """Draw the patient's directions at those edges of the rendering that are close enough to one."""
    width, height = camera.size
    size = text_size(height)
    margin = 1.2 * size
    towards = np.subtract(camera.position_mm, camera.focal_point_mm)
    rightwards = np.cross(camera.view_up, towards)
    upwards = np.cross(towards, rightwards)
    for x, y, outwards in (
        (margin, height / 2, -rightwards),
        (width - margin, height / 2, rightwards),
        (width / 2, margin, upwards),
        (width / 2, height - margin, -upwards),
    ):
        letter = _letter(outwards)
        if letter:
            canvas.label(x, y, letter, size, anchor="center")


def _letter(outwards: np.ndarray) -> str:
    """R, L, A, P, S or I if a direction (3,) RAS is less than 40° away from it; otherwise an empty string."""
    shares = outwards / np.linalg.norm(outwards)
    return "" if abs(shares).max() < np.cos(np.radians(40.0)) else nearest_side(outwards)
