"""A picture of segments over their volume in three anatomical planes: axial, coronal and sagittal.

The planes are those of the patient, not of the voxel grid: oblique and anisotropic volumes appear upright and undistorted.
Directions are the radiologist's: the patient's right on the picture's left, anterior up in the axial plane and to the left in
the sagittal one, superior up in the other two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from ViTTransferFunction.CommandLine.canvas import (
    FAINT_TEXT,
    Canvas,
    PictureSegment,
    check_segments,
    draw_legend,
    legend_height,
)
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.measures import position_decimals
from ViTTransferFunction.Logic.core.volumes.patient_sides import SIDES
from ViTTransferFunction.Logic.core.volumes.volume import Volume

FILL = 0.35
"""Share of a segment's colour in its filled area, at opacity 1."""


@dataclass(frozen=True, eq=False)
class PicturePoint:
    """An annotation to mark.

    Attributes:
        position_ras: (3,) RAS millimetres.
        segment: index of the segment that it belongs to.
        positive: whether the point lies inside the class, not outside.
    """

    position_ras: np.ndarray
    segment: int
    positive: bool = True


@dataclass(frozen=True)
class _Plane:
    """An anatomical plane: signed RAS axes that point to the picture's right and up, and the axis that it cuts."""

    name: str
    right: tuple[int, int]
    up: tuple[int, int]
    normal: int


_R, _A, _S = 0, 1, 2
_PLANES = (
    _Plane("Axial", right=(_R, -1), up=(_A, +1), normal=_S),
    _Plane("Coronal", right=(_R, -1), up=(_S, +1), normal=_A),
    _Plane("Sagittal", right=(_A, -1), up=(_S, +1), normal=_R),
)


def draw_slices(
    volume: Volume,
    segments: Sequence[PictureSegment],
    *,
    window: tuple[float, float],
    points: Sequence[PicturePoint] = (),
    width: int = 1800,
) -> np.ndarray:
    """Draw the axial, coronal and sagittal plane side by side, segments filled and outlined in their colours, with a legend.

    The planes pass where most segments have a large area or points. Segments without voxels stay in the legend.

    Args:
        volume: the intensities, shown in grey.
        segments: the segments to show on top, later ones over earlier ones. May be empty.
        window: intensities shown black and white.
        points: annotations; those close to a plane are marked, positive ones by a disc, negative ones by a disc with a bar.
        width: the picture's width in pixels; its height follows from the volume's shape.

    Returns:
        The picture, (H, width, 3) uint8.

    Raises:
        InputError: the window's bounds are not increasing.
        ValueError: a mask's shape is not the volume's.
    """
    check_segments(segments, volume.shape)
    low, high = _ras_box(volume.geometry)
    centre = _centre(volume.geometry, segments, points, low, high)

    gap, text_size = round(width * 0.008), max(10, round(width * 0.011))
    sizes = _panel_sizes(high - low, width - gap * (len(_PLANES) + 1))
    panel_height = sizes[0][1]
    height = gap + panel_height + gap + legend_height(segments, width, text_size) + gap
    canvas = Canvas(width, height)
    left = gap
    for plane, (panel_width, _) in zip(_PLANES, sizes, strict=True):
        panel = _Panel(plane, centre, (low + high) / 2, high - low, panel_width, panel_height)
        pixels = _draw_panel(panel, volume, segments, IntensityWindow(*window), points, text_size)
        canvas.pixels[gap : gap + panel_height, left : left + panel_width] = pixels
        left += panel_width + gap
    draw_legend(canvas, gap + panel_height + gap, segments, text_size)
    return canvas.picture()


class _Panel:
    """One plane's place in the picture: which point of the patient each of its pixels shows.

    Args:
        plane: its orientation.
        centre: (3,) a point in the plane, RAS.
        middle: (3,) the middle of the volume's box, shown in the middle of the panel, RAS.
        extent: (3,) edge lengths of that box, millimetres along R, A, S; all of it is visible.
        width, height: pixels.
    """

    def __init__(self, plane: _Plane, centre: np.ndarray, middle: np.ndarray, extent: np.ndarray, width: int, height: int):
        self.plane, self.width, self.height = plane, width, height
        self.mm_per_pixel = max(extent[plane.right[0]] / width, extent[plane.up[0]] / height)
        self.origin = middle.copy()
        self.origin[plane.normal] = centre[plane.normal]

    def pixel_positions(self) -> np.ndarray:
        """RAS positions of all pixels' centres, (height × width, 3), row by row."""
        positions = np.empty((self.height, self.width, 3))
        positions[:] = self.origin
        across = (np.arange(self.width) - (self.width - 1) / 2) * self.mm_per_pixel
        down = (np.arange(self.height) - (self.height - 1) / 2) * self.mm_per_pixel
        positions[..., self.plane.right[0]] += self.plane.right[1] * across
        positions[..., self.plane.up[0]] -= self.plane.up[1] * down[:, None]
        return positions.reshape(-1, 3)

    def pixel_of(self, position: np.ndarray) -> tuple[float, float]:
        """(x, y) in pixels of an RAS position, seen along the plane's normal."""
        offset = (position - self.origin) / self.mm_per_pixel
        x = (self.width - 1) / 2 + self.plane.right[1] * offset[self.plane.right[0]]
        y = (self.height - 1) / 2 - self.plane.up[1] * offset[self.plane.up[0]]
        return float(x), float(y)

    def distance_mm(self, position: np.ndarray) -> float:
        """How far an RAS position lies from the plane."""
        return float(abs(position[self.plane.normal] - self.origin[self.plane.normal]))


def _ras_box(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest R, A, S of the volume's box, (3,) each."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * geometry.shape[::-1] - 0.5
    ras = geometry.ijk_to_ras_points(corners)
    return ras.min(axis=0), ras.max(axis=0)


def _centre(
    geometry: Geometry, segments: Sequence[PictureSegment], points: Sequence[PicturePoint], low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """RAS position (3,) through which the planes pass.

    Along each axis, it is where the segments' areas, each relative to its largest, and a quarter for each point have the
    largest sum; without segments and points, it is the middle of the box.
    """
    bin_mm = float(geometry.spacing_mm.max())
    counts = np.maximum(np.ceil((high - low) / bin_mm).astype(int), 1)
    scores = [np.zeros(count) for count in counts]
    for segment in segments:
        areas = [np.zeros(count, dtype=int) for count in counts]
        # Slice by slice: about a hundred bytes for each voxel of a large segment would be many times the size of the scan.
        for k in np.flatnonzero(segment.mask.any(axis=(1, 2))):
            j, i = np.nonzero(segment.mask[k])
            positions = geometry.ijk_to_ras_points(np.stack([i, j, np.full_like(i, k)], axis=1))
            for axis, area in enumerate(areas):
                area += np.bincount(_bins(positions[:, axis], low[axis], bin_mm, counts[axis]), minlength=counts[axis])
        for score, area in zip(scores, areas, strict=True):
            score += area / max(area.max(), 1)
    for point in points:
        for axis, score in enumerate(scores):
            score[_bins(point.position_ras[axis : axis + 1], low[axis], bin_mm, counts[axis])] += 0.25
    best = [low[axis] + (int(score.argmax()) + 0.5) * bin_mm for axis, score in enumerate(scores)]
    return np.where([score.any() for score in scores], best, (low + high) / 2)


def _bins(values: np.ndarray, low: float, bin_mm: float, count: int) -> np.ndarray:
    return np.clip(((values - low) / bin_mm).astype(int), 0, count - 1)


def _panel_sizes(extent: np.ndarray, width: int) -> list[tuple[int, int]]:
    """Width and height of each plane's panel: all of the same height, together `width` wide, none too narrow to be legible."""
    aspects = np.array([extent[plane.right[0]] / extent[plane.up[0]] for plane in _PLANES]).clip(0.4, 2.5)
    height = width / aspects.sum()
    return [(int(aspect * height), int(height)) for aspect in aspects]


def _draw_panel(
    panel: _Panel,
    volume: Volume,
    segments: Sequence[PictureSegment],
    window: IntensityWindow,
    points: Sequence[PicturePoint],
    text_size: int,
) -> np.ndarray:
    """One panel's pixels (height, width, 3) float32."""
    section = _Section(panel, volume.geometry)
    canvas = Canvas(panel.width, panel.height)
    canvas.pixels[:] = window.apply(section.sample(volume.array, outside=window.low))[..., None]
    for segment in segments:
        if section.crosses(segment.mask):
            _draw_segment(canvas, section.sample(segment.mask), segment, outline=text_size / 9)
    for point in points:
        if panel.distance_mm(point.position_ras) <= volume.geometry.spacing_mm.max():
            _draw_point(canvas, *panel.pixel_of(point.position_ras), segments[point.segment], point.positive, text_size)
    _draw_letters(canvas, panel, text_size, position_decimals(float(volume.geometry.spacing_mm.min())))
    return canvas.pixels


class _Section:
    """The points of a voxel grid that a panel's pixels show.

    Args:
        panel: the pixels.
        geometry: the grid.
    """

    def __init__(self, panel: _Panel, geometry: Geometry):
        self.pixels = panel.height, panel.width
        kji = geometry.ras_to_ijk(panel.pixel_positions())[:, ::-1].T
        last = np.array(geometry.shape)[:, None] - 1
        # Border voxels reach half a voxel beyond their centres.
        self.outside = ((kji < -0.5) | (kji > last + 0.5)).any(axis=0)
        # Only the slab of voxels that the plane passes through is read.
        first = np.clip(np.floor(kji.min(axis=1)), 0, last[:, 0]).astype(int)
        end = np.clip(np.ceil(kji.max(axis=1)), 0, last[:, 0]).astype(int) + 1
        self.slab = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        self.kji = (kji - first[:, None]).astype(np.float32)

    def crosses(self, mask: np.ndarray) -> bool:
        """Whether any voxel near the section is in `mask` (K, J, I)."""
        return bool(mask[self.slab].any())

    def sample(self, array: np.ndarray, outside: float = 0.0) -> np.ndarray:
        """Values of `array` (K, J, I) at the pixels (height, width) float32: trilinear, `outside` outside the grid's box."""
        values = map_coordinates(array[self.slab].astype(np.float32), self.kji, order=1, mode="nearest")
        values[self.outside] = outside
        return values.reshape(self.pixels)


def _draw_segment(canvas: Canvas, inside: np.ndarray, segment: PictureSegment, outline: float) -> None:
    """Fill and outline a segment.

    Args:
        canvas: a panel.
        inside: the segment's mask sampled at the panel's pixels, (height, width), 0 to 1; its border is at a half.
        segment: gives colour and opacity.
        outline: the line's thickness in pixels; it runs just inside the border.
    """
    slope = np.maximum(np.hypot(*np.gradient(inside)), 1e-3)
    depth = (inside - 0.5) / slope
    canvas.blend(0, 0, FILL * segment.opacity * np.clip(depth + 0.5, 0.0, 1.0), segment.color)
    line = np.clip(outline / 2 - abs(depth - outline / 2) + 0.5, 0.0, 1.0)
    canvas.blend(0, 0, line, segment.color)


def _draw_point(canvas: Canvas, x: float, y: float, segment: PictureSegment, positive: bool, text_size: int) -> None:
    radius = 0.42 * text_size
    canvas.disc(x, y, radius + 2.5, (0.0, 0.0, 0.0))
    canvas.disc(x, y, radius + 1.2, (1.0, 1.0, 1.0))
    canvas.disc(x, y, radius, segment.color)
    if not positive:
        canvas.disc(x, y, radius, (0.0, 0.0, 0.0))
        canvas.bar(x, y, 1.5 * radius, 0.5 * radius, segment.color)


def _draw_letters(canvas: Canvas, panel: _Panel, text_size: int, decimals: int) -> None:
    """Write the patient's directions at the panel's edges, and the plane's name and position (with `decimals`) in a corner."""
    plane, margin = panel.plane, 0.9 * text_size
    left, right = SIDES[plane.right[0]][:: plane.right[1]]
    bottom, top = SIDES[plane.up[0]][:: plane.up[1]]
    canvas.label(margin, panel.height / 2, left, text_size, anchor="center")
    canvas.label(panel.width - margin, panel.height / 2, right, text_size, anchor="center")
    canvas.label(panel.width / 2, margin, top, text_size, anchor="center")
    canvas.label(panel.width / 2, panel.height - margin, bottom, text_size, anchor="center")
    position = panel.origin[plane.normal]
    where = f"{SIDES[plane.normal][int(position > 0)]} {abs(position):.{decimals}f} mm"
    canvas.label(0.6 * text_size, margin, plane.name, text_size)
    canvas.label(0.6 * text_size, 2.3 * margin, where, round(0.85 * text_size), FAINT_TEXT)
