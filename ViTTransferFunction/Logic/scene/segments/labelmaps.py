"""The labelmaps of segmentations, each of which may hold several segments under labels of their own."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import slicer
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ...core.volumes.geometry import Box, Geometry
from ...core.volumes.stepped_work import Steps, slabs
from ..mrml.transforms import numpy_matrix, vtk_matrix

LABELMAP = slicer.vtkSegmentationConverter.GetSegmentationBinaryLabelmapRepresentationName()


@dataclass(frozen=True, eq=False)
class Labelmap:
    """A labelmap that is not empty, and some of the segments in it.

    Attributes:
        image: vtkOrientedImageData.
        labels: the label of each of the segments, by its ID.
    """

    image: Any
    labels: dict[str, int]

    @property
    def voxels(self) -> np.ndarray:
        """The labels of the voxels, (K, J, I): a view on them, not a copy."""
        return vtk_to_numpy(self.image.GetPointData().GetScalars()).reshape(self.image.GetDimensions()[::-1])

    @property
    def grid_to_local(self) -> np.ndarray:
        """From indices (i, j, k) of its grid to the segmentation's local frame, 4×4; its voxels lie anywhere on the grid."""
        image_to_world = vtk.vtkMatrix4x4()
        self.image.GetImageToWorldMatrix(image_to_world)
        return numpy_matrix(image_to_world)

    @property
    def geometry(self) -> Geometry:
        """Of the voxels, in the segmentation's local frame."""
        extent = self.image.GetExtent()
        k, j, i = (slice(extent[2 * axis], extent[2 * axis + 1] + 1) for axis in (2, 1, 0))
        return Geometry((0, 0, 0), self.grid_to_local).part((k, j, i))


def labelmaps_of(segmentation: Any, segment_ids: Collection[str]) -> list[Labelmap]:
    """The labelmaps that hold these segments of a vtkSegmentation, as far as there are such; not those that are empty."""
    labels: dict[Any, dict[str, int]] = {}
    for segment_id in segment_ids:
        segment = segmentation.GetSegment(segment_id)
        if segment is not None:
            labels.setdefault(segment.GetRepresentation(LABELMAP), {})[segment_id] = segment.GetLabelValue()
    return [Labelmap(image, of_image) for image, of_image in labels.items() if image is not None and not image.IsEmpty()]


def new_image(grid: Geometry, box: Box, dtype: np.dtype) -> Any:
    """An image of labels for a box of a grid, its voxels not yet set.

    It shares the grid's origin and says by its extent where it lies: by that, Slicer knows labelmaps of the same grid.
    """
    image = slicer.vtkOrientedImageData()
    image.SetImageToWorldMatrix(vtk_matrix(grid.ijk_to_ras))
    if all(extent.stop > extent.start for extent in box):
        image.SetExtent([bound for part in reversed(box) for bound in (part.start, part.stop - 1)])
        image.AllocateScalars(vtk.VTK_UNSIGNED_CHAR if dtype == np.uint8 else vtk.VTK_UNSIGNED_SHORT, 1)
    return image


def without_labels(labelmap: Labelmap, labels: Collection[int]) -> Steps[Any]:
    """A copy of a labelmap's image in which these labels are free; in steps."""
    image = slicer.vtkOrientedImageData()
    image.CopyDirections(labelmap.image)
    image.SetOrigin(labelmap.image.GetOrigin())
    image.SetSpacing(labelmap.image.GetSpacing())
    image.SetExtent(labelmap.image.GetExtent())
    image.AllocateScalars(labelmap.image.GetScalarType(), 1)
    source, copy = labelmap.voxels, Labelmap(image, {}).voxels
    k, j, i = (slice(0, size) for size in source.shape)
    for slab in slabs((k, j, i)):
        part = copy[slab]
        np.copyto(part, source[slab])
        part[np.isin(part, list(labels))] = 0
        yield part.size
    return image
