"""Labelmaps of segmentations: masks into them, and what they hold, on a grid of one's own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import slicer
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from ..core.geometry import Box, Geometry
from ..core.resampling import resample_labels
from .volume import numpy_matrix, vtk_matrix

LABELMAP = slicer.vtkSegmentationConverter.GetSegmentationBinaryLabelmapRepresentationName()


def labelmaps_from_masks(masks: Sequence[np.ndarray], grid: Geometry, box: Box) -> list[tuple[Any, int]]:
    """Masks as labelmaps, each of which holds as many masks as fit without overlap.

    Args:
        masks: bool, each of the box's shape.
        grid: of which the masks are a part, in the segmentation's local frame.
        box: where in the grid the masks lie.

    Returns:
        For each mask the labelmap that holds it (vtkOrientedImageData) and its label there.
    """
    layers: list[np.ndarray] = []
    layer_of_mask: list[int] = []
    for label, mask in enumerate(masks, start=1):
        layer = next((index for index, labels in enumerate(layers) if not labels[mask].any()), len(layers))
        if layer == len(layers):
            layers.append(np.zeros(mask.shape, np.uint8 if len(masks) < 256 else np.uint16))
        layers[layer][mask] = label
        layer_of_mask.append(layer)
    images = [_image(labels, grid, box) for labels in layers]
    return [(images[layer], label) for label, layer in enumerate(layer_of_mask, start=1)]


def occupied_voxels(segmentation: Any, segment_ids: Sequence[str], grid: Geometry, box: Box) -> np.ndarray:
    """Which voxel centres lie in any of these segments, whatever grids those are on.

    Args:
        segmentation: vtkSegmentation with binary labelmaps.
        segment_ids: which of its segments.
        grid: in the segmentation's local frame.
        box: the part of the grid that is asked for.

    Returns:
        bool, of the box's shape.
    """
    part = grid.part(box)
    occupied = np.zeros(part.shape, dtype=bool)
    if occupied.size:
        for labels, geometry, values in _layers(segmentation, segment_ids):
            occupied |= resample_labels(np.isin(labels, values), geometry, part)
    return occupied


def _image(labels: np.ndarray, grid: Geometry, box: Box) -> Any:
    """Shares the grid's origin and says by its extent where it lies: by that, Slicer knows labelmaps of the same grid."""
    image = slicer.vtkOrientedImageData()
    image.SetImageToWorldMatrix(vtk_matrix(grid.ijk_to_ras))
    if labels.size:
        image.SetExtent([bound for part in reversed(box) for bound in (part.start, part.stop - 1)])
        image.GetPointData().SetScalars(numpy_to_vtk(labels.ravel(), deep=True))
    return image


def _layers(segmentation: Any, segment_ids: Sequence[str]) -> Iterator[tuple[np.ndarray, Geometry, list[int]]]:
    """Each labelmap with its geometry and the labels of those of the segments that are in it."""
    values: dict[Any, list[int]] = {}
    for segment_id in segment_ids:
        segment = segmentation.GetSegment(segment_id)
        values.setdefault(segment.GetRepresentation(LABELMAP), []).append(segment.GetLabelValue())
    for image, labels in values.items():
        if not image.IsEmpty():
            yield _voxels(image), _geometry(image), labels


def _voxels(image: Any) -> np.ndarray:
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[::-1])


def _geometry(image: Any) -> Geometry:
    image_to_world = vtkMatrix4x4()
    image.GetImageToWorldMatrix(image_to_world)
    extent = image.GetExtent()
    k, j, i = (slice(extent[2 * axis], extent[2 * axis + 1] + 1) for axis in (2, 1, 0))
    return Geometry((0, 0, 0), numpy_matrix(image_to_world)).part((k, j, i))
