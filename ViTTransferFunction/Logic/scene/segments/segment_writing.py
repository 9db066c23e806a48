"""Segments of a segmentation node, written all at once beside segments that others made and that must not change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import slicer

from ...core.classes.colors import Color
from ...core.system.errors import InputError
from ..mrml.data_tree import put_beside
from ..mrml.nodes import one_modification
from ..mrml.transforms import matrix_to_world
from ..volumes.volume_nodes import geometry_from_node
from .labelmaps import LABELMAP
from .segment_preparation import PreparedSegments, takes_transform
from .segment_tags import CLASS_TAG, COLOR_TAG, CORRECTED_TAG, NAME_TAG, SEGMENT_TAG, VOXELS_TAG, read_tag, set_tag
from .terminology import StandardCodes
from .written_segments import note_written

REFERENCE_GEOMETRY = slicer.vtkSegmentationConverter.GetReferenceImageGeometryParameterName()


@dataclass(frozen=True)
class ClassLook:
    """What a segment shows of its class: what the user calls it, and red, green and blue in [0, 1]."""

    name: str
    color: Color


def check_writable(segmentation_node: Any, volume_node: Any) -> None:
    """Raise InputError where the segmentation stores surfaces, or one of the nodes is under a non-linear transform."""
    segmentation = segmentation_node.GetSegmentation()
    source = segmentation.GetSourceRepresentationName()
    if segmentation.GetNumberOfSegments() and source != LABELMAP:
        raise InputError(
            f"The segmentation '{segmentation_node.GetName()}' is stored as '{source}'; expected '{LABELMAP}'. Choose or make "
            "another segmentation. Or convert this one in Slicer, which changes its segments a little: in the module "
            f"Segmentations, under Representations, press Create and then Make source beside '{LABELMAP}'."
        )
    matrix_to_world(segmentation_node)
    geometry_from_node(volume_node)


def write_prepared(
    prepared: PreparedSegments,
    segmentation_node: Any,
    volume_node: Any,
    looks: Mapping[str, ClassLook],
    codes: StandardCodes,
    source: str,
) -> list[str]:
    """Give each class its segment, which is made the first time, and remove those of classes that are gone.

    No other segment changes by a single voxel.

    A segment keeps the name, colour and terminology that the user gave it in Slicer until the class is renamed or recoloured.

    Args:
        prepared: for this segmentation and volume as they are now.
        segmentation_node: where to. One without segments is set up for the volume: reference geometry, transform, display, and
            where the Data module lists it.
        volume_node: the segmented volume.
        looks: of each class that was prepared, by its id.
        codes: for classes that are named like a known structure.
        source: what the segments were made from (`source_digest`).

    Returns:
        The segments' IDs, in the order of the classes.
    """
    segmentation, ids = segmentation_node.GetSegmentation(), dict(prepared.ids)
    ours = {*ids.values(), *prepared.removed}
    others = [segment_id for segment_id in segmentation.GetSegmentIDs() if segment_id not in ours]
    for image in {prepared.image, *prepared.freed.values()}:
        # The Segment Editor's undo takes voxels for those that it saved last where they are older than what it saved.
        image.Modified()
    with one_modification(segmentation_node), _derived_representations_renewed(segmentation):
        _set_up(segmentation_node, volume_node, others)
        for class_id, segment_id in prepared.kept.items():
            _leave_to_user(segmentation.GetSegment(segment_id), class_id)
        for segment_id, image in prepared.freed.items():
            segmentation.GetSegment(segment_id).AddRepresentation(LABELMAP, image)
        for segment_id in prepared.removed:
            segmentation.RemoveSegment(segment_id)
        for class_id, label in prepared.labels.items():
            look = looks[class_id]
            new = class_id not in ids
            segment = slicer.vtkSegment() if new else segmentation.GetSegment(ids[class_id])
            name = _free_name(segmentation, look.name) if new else look.name
            _dress(segment, class_id, look, name, codes)
            ids.setdefault(class_id, segmentation.GenerateUniqueSegmentID())
            set_tag(segment, SEGMENT_TAG, ids[class_id])
            _give_voxels(segment, prepared, label)
            if new:
                segmentation.AddSegment(segment, ids[class_id])
        for class_id in prepared.labels:
            segmentation.InvokeEvent(segmentation.SourceRepresentationModified, ids[class_id])
            segmentation.InvokeEvent(segmentation.RepresentationModified, ids[class_id])
        note_written(segmentation_node, prepared.labels, source, volume_node)
    return [ids[class_id] for class_id in prepared.labels]


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
    if takes_transform(segmentation_node):
        segmentation_node.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
    if not segmentation.GetNumberOfSegments():
        segmentation.SetSourceRepresentationName(LABELMAP)
        # As Slicer's Segment Editor does.
        put_beside(segmentation_node.GetScene(), segmentation_node, volume_node)
    if not others or not segmentation.GetConversionParameter(REFERENCE_GEOMETRY):
        segmentation_node.SetReferenceImageGeometryParameterFromVolumeNode(volume_node)
    segmentation_node.CreateDefaultDisplayNodes()


def _leave_to_user(segment: Any, class_id: str) -> None:
    """From now on the segment is the user's, whatever becomes of its class."""
    segment.RemoveTag(CLASS_TAG)
    segment.RemoveTag(VOXELS_TAG)
    set_tag(segment, CORRECTED_TAG, class_id)


def _free_name(segmentation: Any, name: str) -> str:
    taken = {segmentation.GetSegment(segment_id).GetName() for segment_id in segmentation.GetSegmentIDs()}
    numbered = (f"{name} ({number})" for number in range(2, len(taken) + 3))
    return next(free for free in (name, *numbered) if free not in taken)


def _dress(segment: Any, class_id: str, look: ClassLook, name: str, codes: StandardCodes) -> None:
    """Note the class, and pass on what was changed in it since; `name` is how the segment is called for the class's name."""
    set_tag(segment, CLASS_TAG, class_id)
    if read_tag(segment, NAME_TAG) != look.name:
        _update_terminology(segment, read_tag(segment, NAME_TAG), look.name, codes)
        segment.SetName(name)
        segment.SetNameAutoGenerated(False)
        set_tag(segment, NAME_TAG, look.name)
    color = " ".join(f"{component:.6f}" for component in look.color)
    if read_tag(segment, COLOR_TAG) != color:
        segment.SetColor(*look.color)
        segment.SetColorAutoGenerated(False)
        set_tag(segment, COLOR_TAG, color)


def _give_voxels(segment: Any, prepared: PreparedSegments, label: int) -> None:
    segment.SetLabelValue(label)
    segment.AddRepresentation(LABELMAP, prepared.image)
    segment.RemoveAllRepresentations(LABELMAP)
    set_tag(segment, VOXELS_TAG, prepared.digests[label].to_text())


def _update_terminology(segment: Any, old_name: str | None, name: str, codes: StandardCodes) -> None:
    """Standard codes for a new name, unless the user chose others: a segment renamed to spleen must not stay coded as liver."""
    default = slicer.vtkSegment().GetTerminology()
    given = codes.entry(old_name) if old_name else None
    if segment.GetTerminology() in (given or default, default):
        segment.SetTerminology(codes.entry(name) or default)
