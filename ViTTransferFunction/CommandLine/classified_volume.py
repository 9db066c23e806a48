"""All classes in one volume of colours, so that one direct volume rendering shows any number of iso-surfaces.

A scalar volume takes one transfer function, and VTK renders few volumes at once. So the transfer functions are applied here:
every voxel gets the colour of its class, and a code that says how far above that class's iso-surface it lies and how opaque
that surface is. A renderer interpolates the code, takes opacity from it (`surface_opacity`) and normals from its gradient.

    code   0 ……………… SURFACE ……… SURFACE + (255 - SURFACE) × opacity
    where  a ramp outside     on the surface     a ramp inside, and deeper

The outer half is transparent and alike for all classes: it only carries normals. Opacity gathers in the inner half, and a class
that encloses another, more opaque one has the lower code, so that the inner surface stands out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion, distance_transform_edt, gaussian_filter, uniform_filter
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkCommonTransforms import vtkMatrixToLinearTransform
from vtkmodules.vtkImagingCore import vtkImageReslice

from ViTTransferFunction.CommandLine.canvas import PictureSegment
from ViTTransferFunction.Logic.core.geometry import Geometry

SURFACE = 127
"""Code on every iso-surface."""

VOXEL_BUDGET = 12_000_000
"""Voxels of the classified volume: as fine as software OpenGL renders in a few seconds."""

RAMP_VOXELS = 3.0
"""Half the ramp's width. Narrower, and central differences no longer see the whole ramp: normals become those of the grid."""


@dataclass(frozen=True, eq=False)
class ClassifiedVolume:
    """Colours and codes on an isotropic grid whose axes are R, A and S.

    Attributes:
        rgba: (S, A, R, 4) uint8; colour, shaded by occlusion, and code.
        origin_ras: (3,) centre of the first voxel, RAS millimetres.
        spacing_mm: distance between voxels.
    """

    rgba: np.ndarray
    origin_ras: np.ndarray
    spacing_mm: float

    @property
    def ramp_mm(self) -> float:
        """Distance over which codes rise from the surface to the class's deepest code."""
        return RAMP_VOXELS * self.spacing_mm

    @property
    def far_corner_ras(self) -> np.ndarray:
        """(3,) centre of the last voxel, RAS millimetres."""
        return self.origin_ras + (np.array(self.rgba.shape[2::-1]) - 1) * self.spacing_mm


def classify(geometry: Geometry, segments: Sequence[PictureSegment]) -> ClassifiedVolume:
    """Bring segments into one volume of colours that just encloses them.

    Args:
        geometry: the segments' grid.
        segments: at least one of them with voxels. Where two overlap, the more opaque one shows.
    """
    boxes = [_ras_box(geometry, segment.mask) for segment in segments if segment.mask.any()]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    # Twice the grid's finest resolution shows all that is there.
    spacing_mm = max(float(np.cbrt(np.prod(high - low) / VOXEL_BUDGET)), geometry.spacing_mm.min() / 2)
    origin = low - 1.5 * RAMP_VOXELS * spacing_mm
    shape = np.ceil((high - low) / spacing_mm + 3 * RAMP_VOXELS).astype(int)[::-1] + 1

    classified = ClassifiedVolume(np.zeros((*shape, 4), dtype=np.uint8), origin, spacing_mm)
    for segment in segments:
        if segment.mask.any():
            _add(classified, geometry, segment)
    _shade(classified)
    return classified


def surface_opacity(classified: ClassifiedVolume, per_mm: float) -> np.ndarray:
    """Opacity of a stretch of `per_mm` millimetres at each code, (256,) float64, 0 to 1.

    Chosen so that a ray straight through a surface of opacity o gathers just o. On its way through the inner ramp, w long, it
    meets codes x = 0 … o of density τ(x), so w/o ∫₀ᵒ τ dx = -ln(1-o) for every o, and therefore τ = (-ln(1-x) + x/(1-x)) / w.
    """
    x = np.clip((np.arange(256) - SURFACE) / (255.0 - SURFACE), 0.0, 1.0)
    with np.errstate(divide="ignore"):
        density = (-np.log1p(-x) + x / (1.0 - x)) / classified.ramp_mm
    return 1.0 - np.exp(-density * per_mm)


def _ras_box(geometry: Geometry, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest R, A, S of the mask's voxels, (3,) each."""
    first, end = _index_box(mask)
    corners = np.array([[i, j, k] for i in (first[2], end[2]) for j in (first[1], end[1]) for k in (first[0], end[0])])
    ras = geometry.ijk_to_ras_points(corners - 0.5)
    return ras.min(axis=0), ras.max(axis=0)


def _index_box(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and one past the last (k, j, i) of the mask's voxels."""
    extents = [np.flatnonzero(mask.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    return np.array([e[0] for e in extents]), np.array([e[-1] + 1 for e in extents])


def _add(classified: ClassifiedVolume, geometry: Geometry, segment: PictureSegment) -> None:
    """Write a segment's colour and codes wherever they exceed what is there."""
    height_mm, first_ijk, step_ijk = _height(geometry, segment, classified)
    low, high = _ras_box(geometry, segment.mask)
    margin = 1.5 * classified.ramp_mm
    first = np.floor((low - margin - classified.origin_ras) / classified.spacing_mm).astype(int).clip(0)
    end = np.ceil((high + margin - classified.origin_ras) / classified.spacing_mm).astype(int) + 1
    end = np.minimum(end, classified.rgba.shape[2::-1])

    to_source = np.linalg.inv(geometry.ijk_to_ras @ _scale_and_shift(step_ijk, first_ijk))
    origin = classified.origin_ras + first * classified.spacing_mm
    heights = _resample(height_mm, to_source, origin, classified.spacing_mm, end - first) / classified.ramp_mm
    deepest = SURFACE + (255 - SURFACE) * segment.opacity
    codes = np.rint(np.interp(heights, [-1.0, 0.0, 1.0], [0.0, SURFACE, deepest])).astype(np.uint8)

    region = classified.rgba[tuple(slice(a, b) for a, b in zip(first[::-1], end[::-1], strict=True))]
    higher = codes > region[..., 3]
    region[higher, :3] = np.rint(255.0 * np.array(segment.color))
    region[higher, 3] = codes[higher]


def _height(
    geometry: Geometry, segment: PictureSegment, classified: ClassifiedVolume
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far inside the segment's surface the voxels around it lie, in millimetres (negative: outside).

    Returns:
        The heights (K', J', I') float32; where in the segment's grid their first voxel lies, (i, j, k); their steps there.
    """
    box_first, box_end = _index_box(segment.mask)
    # Voxels much finer than what is rendered only cost time.
    step = np.maximum(np.round(classified.spacing_mm / geometry.spacing_mm), 1).astype(int)[::-1]
    if not segment.mask[_box(box_first, box_end, step)].any():
        step = np.ones_like(step)
    box = _box(box_first, box_end, step)
    spacing = geometry.spacing_mm[::-1] * step
    margin = np.ceil(1.5 * classified.ramp_mm / spacing).astype(int) + 3
    # The margin may reach beyond the volume: a segment that the volume's border cuts gets a flat face there.
    mask = np.pad(segment.mask[box], [(n, n) for n in margin])
    height = _height_from_mask(mask, spacing)
    if segment.similarity is not None:
        similarity = np.pad(np.nan_to_num(segment.similarity[box].astype(np.float32)), [(n, n) for n in margin], mode="edge")
        # The map places the surface to a fraction of a voxel; the mask says which parts of the map belong to the segment.
        by_map = _height_from_similarity(similarity, segment.iso, mask, spacing)
        height = np.minimum(by_map, height + spacing.max())
    return height.astype(np.float32), (box_first - margin * step)[::-1], step[::-1]


def _box(first: np.ndarray, end: np.ndarray, step: np.ndarray) -> tuple[slice, ...]:
    return tuple(slice(a, b, n) for a, b, n in zip(first, end, step, strict=True))


def _height_from_mask(mask: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Signed distance from the mask's border in millimetres, smoothed as far as thin structures survive it."""
    distance = distance_transform_edt(mask, sampling=spacing) - distance_transform_edt(~mask, sampling=spacing)
    distance = np.clip(distance, -4 * spacing.max(), 4 * spacing.max())
    # By a voxel, and within thick slices by a part of their distance: their borders jump from one to the next.
    sigma = np.maximum(0.8 * spacing, 0.5 * spacing.max()) / spacing
    for strength in (1.0, 0.6):
        height = gaussian_filter(distance, strength * sigma)
        if np.median(height[mask]) > 0.2 * np.median(distance[mask]):
            return height
    return distance


def _height_from_similarity(similarity: np.ndarray, iso: float | None, mask: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """The map's height over its iso value, in millimetres at the slope that it typically has at the mask's border."""
    slope = np.sqrt(sum(component**2 for component in np.gradient(similarity, *spacing)))
    typical = np.median(slope[mask & ~binary_erosion(mask)])
    return gaussian_filter((similarity - iso) / max(float(typical), 1e-6), 0.5)


def _scale_and_shift(scale: np.ndarray, shift: np.ndarray) -> np.ndarray:
    matrix = np.diag([*scale.astype(float), 1.0])
    matrix[:3, 3] = shift
    return matrix


def _resample(array: np.ndarray, to_source: np.ndarray, origin: np.ndarray, spacing_mm: float, count: np.ndarray) -> np.ndarray:
    """`array` (K, J, I) at an isotropic RAS grid of `count` voxels along R, A, S: cubic, its minimum outside.

    `to_source` maps RAS millimetres to the array's (i, j, k). Returns (S, A, R) float32.
    """
    image = vtkImageData()
    image.SetDimensions(*array.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(array).ravel()))
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(to_source.ravel().tolist())
    transform = vtkMatrixToLinearTransform()
    transform.SetInput(matrix)
    reslice = vtkImageReslice()
    reslice.SetInputData(image)
    reslice.SetResliceTransform(transform)
    reslice.SetInterpolationModeToCubic()
    reslice.SetBackgroundLevel(float(array.min()))
    reslice.SetOutputOrigin(*origin)
    reslice.SetOutputSpacing(spacing_mm, spacing_mm, spacing_mm)
    reslice.SetOutputExtent(0, int(count[0]) - 1, 0, int(count[1]) - 1, 0, int(count[2]) - 1)
    reslice.Update()
    # Copied: VTK's array dies with the filter.
    return vtk_to_numpy(reslice.GetOutput().GetPointData().GetScalars()).reshape(count[::-1]).copy()


def _shade(classified: ClassifiedVolume) -> None:
    """Darken colours where much opaque matter lies around and towards the light: soft shadows that cost a renderer nothing."""
    codes = classified.rgba[::2, ::2, ::2, 3].astype(np.float32)
    matter = np.clip((codes - SURFACE) / (255 - SURFACE), 0.0, 1.0)
    # Steps along S, A, R to the light, which comes from above and the front right, in units of the reach.
    to_light = np.array([0.5, 0.6, 0.3])
    occlusion = np.zeros_like(matter)
    for reach_mm in (5.0, 16.0):
        reach = reach_mm / (2 * classified.spacing_mm)
        around = gaussian_filter(matter, reach, mode="constant", truncate=2.5)
        shift = np.round(to_light * reach).astype(int)
        occlusion += 0.5 * np.pad(around, [(0, n) for n in shift])[tuple(slice(n, None) for n in shift)]
    light = np.clip(1.2 - 1.0 * occlusion, 0.3, 1.1)
    for axis in range(3):
        light = light.repeat(2, axis=axis)
    light = uniform_filter(light[tuple(slice(n) for n in classified.rgba.shape[:3])], 3)
    for channel in range(3):
        colors = classified.rgba[..., channel]
        colors[:] = np.clip(colors * light, 0.0, 255.0)
