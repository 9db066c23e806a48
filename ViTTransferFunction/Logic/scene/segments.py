"""Classes' masks as segments of a segmentation node, beside segments that others made and that must not change.

A segment of ours carries tags: which class it is of, and the name and colour that were written last. By these, writing again
finds it, and tells what the user changed in Slicer from what was changed in the class.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
import slicer
from vtkmodules.vtkCommonCore import reference

from ..core.bounding_box import bounding_box, common_box
from ..core.colors import Color
from ..core.errors import InputError
from ..core.geometry import Box, Geometry
from .labelmaps import LABELMAP, labelmaps_from_masks, occupied_voxels
from .terminology import terminology_entry
from .volume import geometry_from_node, matrix_to_world

CLASS_TAG = "ViTTransferFunction.class"
NAME_TAG = "ViTTransferFunction.name"
COLOR_TAG = "ViTTransferFunction.color"

_EMPTY: Box = (slice(0, 0), slice(0, 0), slice(0, 0))

REFERENCE_GEOMETRY = slicer.vtkSegmentationConverter.GetReferenceImageGeometryParameterName()


@dataclass(frozen=True, eq=False)
class OutputSegment:
    """One class's result.

    Attributes:
        class_id: identifies the class for as long as it lives, whatever it is named.
        name: of the class.
        color: of the class, red, green and blue in [0, 1].
        mask: bool (K, J, I), on the grid of the segmented volume. May be empty.
    """

    class_id: str
    name: str
    color: Color
    mask: np.ndarray


def write_segments(
    segmentation_node: Any,
    volume_node: Any,
    segments: Sequence[OutputSegment],
    respect_others: bool,
    app_logic: Any = None,
) -> list[str]:
    """Write each class's mask to its segment, which is made the first time. No other segment changes by a single voxel.

    A segment keeps the name, colour and terminology that the user gave it in Slicer until the class is renamed or recoloured.
    Other segments are those that this call does not write, also finished ones of classes that are gone. An error leaves the
    segmentation as it was.

    Args:
        segmentation_node: where to. One without segments is set up for the volume: reference geometry, transform, display.
        volume_node: the segmented volume.
        segments: at least one, of different classes.
        respect_others: leave out voxels that belong to other segments; otherwise segments may overlap with those.
        app_logic: Slicer's application logic; with it, classes named like a known structure get its standard codes.

    Returns:
        The segments' IDs, in the order of `segments`.

    Raises:
        InputError: the segmentation stores surfaces, or one of the nodes is under a non-linear transform.
    """
    segmentation = segmentation_node.GetSegmentation()
    _check_stores_voxels(segmentation_node)
    grid = _grid_in_segmentation(volume_node, segmentation_node)
    _check_masks(segments, grid)

    ids = _ids_of_classes(segmentation, {segment.class_id for segment in segments})
    others = [segment_id for segment_id in segmentation.GetSegmentIDs() if segment_id not in ids.values()]
    boxes = [box for segment in segments if (box := bounding_box(segment.mask)) is not None]
    box = common_box(boxes) if boxes else _EMPTY
    masks = [segment.mask[box] for segment in segments]
    if respect_others:
        free = ~occupied_voxels(segmentation, others, grid, box)
        masks = [mask & free for mask in masks]
    labelmaps = labelmaps_from_masks(masks, grid, box)
    terminologies_logic = app_logic.GetModuleLogic("Terminologies") if app_logic else None

    with _one_modification(segmentation_node), _derived_representations_renewed(segmentation):
        _set_up(segmentation_node, volume_node, others)
        for segment, (labelmap, label) in zip(segments, labelmaps, strict=True):
            if segment.class_id in ids:
                _leave_shared_labelmap(segmentation, ids[segment.class_id], others)
                _write(segmentation.GetSegment(ids[segment.class_id]), segment, labelmap, label, terminologies_logic)
            else:
                written = slicer.vtkSegment()
                _write(written, segment, labelmap, label, terminologies_logic)
                ids[segment.class_id] = segmentation.GenerateUniqueSegmentID()
                segmentation.AddSegment(written, ids[segment.class_id])
        for segment in segments:
            segmentation.InvokeEvent(segmentation.SourceRepresentationModified, ids[segment.class_id])
            segmentation.InvokeEvent(segmentation.RepresentationModified, ids[segment.class_id])
    return [ids[segment.class_id] for segment in segments]


def _check_stores_voxels(segmentation_node: Any) -> None:
    segmentation = segmentation_node.GetSegmentation()
    source = segmentation.GetSourceRepresentationName()
    if segmentation.GetNumberOfSegments() and source != LABELMAP:
        raise InputError(
            f"The segmentation '{segmentation_node.GetName()}' is stored as '{source}'; expected '{LABELMAP}'. Choose or make "
            "another segmentation. Or convert this one, which changes its segments a little: in the module Segmentations, "
            f"under Representations, press Create and then Make source beside '{LABELMAP}'."
        )


def _grid_in_segmentation(volume_node: Any, segmentation_node: Any) -> Geometry:
    """The volume's grid in the local frame of the segmentation, as it will be after `_set_up`."""
    grid = geometry_from_node(volume_node)
    to_segmentation = np.linalg.inv(matrix_to_world(segmentation_node)) @ matrix_to_world(volume_node)
    return grid if _takes_transform(segmentation_node) else Geometry(grid.shape, to_segmentation @ grid.ijk_to_ras)


def _takes_transform(segmentation_node: Any) -> bool:
    """Whether the segmentation is put under the volume's transform, so that both stay together when one is moved."""
    return not segmentation_node.GetSegmentation().GetNumberOfSegments() and not segmentation_node.GetParentTransformNode()


def _check_masks(segments: Sequence[OutputSegment], grid: Geometry) -> None:
    for segment in segments:
        if segment.mask.shape != grid.shape or segment.mask.dtype != bool:
            raise ValueError(f"expected a bool mask {grid.shape}, got {segment.mask.dtype} {segment.mask.shape}")


def _ids_of_classes(segmentation: Any, class_ids: Collection[str]) -> dict[str, str]:
    """IDs of the segments that were written before, by class. A user's copy comes after the segment that it is a copy of."""
    ids: dict[str, str] = {}
    for segment_id in segmentation.GetSegmentIDs():
        class_id = _tag(segmentation.GetSegment(segment_id), CLASS_TAG)
        if class_id is not None and class_id in class_ids:
            ids.setdefault(class_id, segment_id)
    return ids


@contextmanager
def _one_modification(node: Any) -> Iterator[None]:
    was_modifying = node.StartModify()
    try:
        yield
    finally:
        node.EndModify(was_modifying)


@contextmanager
def _derived_representations_renewed(segmentation: Any) -> Iterator[None]:
    """Surfaces, say, that segments had before, they have again afterwards: made where missing, otherwise untouched."""
    names: list[str] = []
    segmentation.GetContainedRepresentationNames(names)
    yield
    for name in names:
        segmentation.CreateRepresentation(name)


def _set_up(segmentation_node: Any, volume_node: Any, others: Sequence[str]) -> None:
    segmentation = segmentation_node.GetSegmentation()
    if _takes_transform(segmentation_node):
        segmentation_node.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
    if not segmentation.GetNumberOfSegments():
        segmentation.SetSourceRepresentationName(LABELMAP)
    if not others or not segmentation.GetConversionParameter(REFERENCE_GEOMETRY):
        segmentation_node.SetReferenceImageGeometryParameterFromVolumeNode(volume_node)
    segmentation_node.CreateDefaultDisplayNodes()


def _leave_shared_labelmap(segmentation: Any, segment_id: str, others: Collection[str]) -> None:
    """Take the segment's voxels out of a labelmap that holds other segments too."""
    sharing: list[str] = []
    segmentation.GetSegmentIDsSharingBinaryLabelmapRepresentation(segment_id, sharing, False)
    if not set(sharing).isdisjoint(others):
        segmentation.SeparateSegmentLabelmap(segment_id)


def _write(segment: Any, output: OutputSegment, labelmap: Any, label: int, terminologies_logic: Any) -> None:
    segment.SetTag(CLASS_TAG, quote(output.class_id))
    if _tag(segment, NAME_TAG) != output.name:
        _update_terminology(segment, _tag(segment, NAME_TAG), output.name, terminologies_logic)
        segment.SetName(output.name)
        segment.SetNameAutoGenerated(False)
        segment.SetTag(NAME_TAG, quote(output.name))
    color = " ".join(f"{component:.6f}" for component in output.color)
    if _tag(segment, COLOR_TAG) != color:
        segment.SetColor(*output.color)
        segment.SetColorAutoGenerated(False)
        segment.SetTag(COLOR_TAG, quote(color))
    segment.SetLabelValue(label)
    segment.AddRepresentation(LABELMAP, labelmap)
    segment.RemoveAllRepresentations(LABELMAP)


def _update_terminology(segment: Any, old_name: str | None, name: str, terminologies_logic: Any) -> None:
    """Standard codes for a new name, unless the user chose others: a segment renamed to spleen must not stay coded as liver."""
    if terminologies_logic is None:
        return
    default = slicer.vtkSegment().GetTerminology()
    given = terminology_entry(terminologies_logic, old_name) if old_name else None
    if segment.GetTerminology() in (given or default, default):
        segment.SetTerminology(terminology_entry(terminologies_logic, name) or default)


def _tag(segment: Any, tag: str) -> str | None:
    """A tag of ours. They are percent-encoded, since files separate tags by characters that names may contain."""
    value = reference("")
    return unquote(str(value)) if segment.GetTag(tag, value) else None
