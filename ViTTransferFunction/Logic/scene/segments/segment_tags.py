"""What is noted on a segment of ours, by tags, which are saved with it: its class, and what was written last.

By these, writing again finds the segment, and tells what the user changed in Slicer from what was changed in the class.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any
from urllib.parse import quote, unquote

from vtkmodules.vtkCommonCore import reference

CLASS_TAG = "ViTTransferFunction.class"
"""The class whose result the segment gets."""
SEGMENT_TAG = "ViTTransferFunction.segment"
"""The segment's own ID, by which it is told from copies that the user made of it, tags and all."""
CORRECTED_TAG = "ViTTransferFunction.correctedClass"
"""The class whose result the segment was, before the user corrected it by hand and chose to keep it so."""
NAME_TAG = "ViTTransferFunction.name"
COLOR_TAG = "ViTTransferFunction.color"
VOXELS_TAG = "ViTTransferFunction.voxels"
"""Digest of the voxels (`VoxelDigest`)."""


def read_tag(segment: Any, tag: str) -> str | None:
    """A tag of ours. They are percent-encoded, since files separate tags by characters that names may contain."""
    value = reference("")
    return unquote(str(value)) if segment.GetTag(tag, value) else None


def set_tag(segment: Any, tag: str, text: str) -> None:
    """Write a tag of ours."""
    segment.SetTag(tag, quote(text))


def segments_of_classes(segmentation: Any, class_ids: Collection[str]) -> dict[str, str]:
    """IDs of the segments that get the results of these classes, by class, where there are such segments already."""
    ids: dict[str, str] = {}
    for segment_id in segmentation.GetSegmentIDs():
        segment = segmentation.GetSegment(segment_id)
        class_id = read_tag(segment, CLASS_TAG)
        if class_id is not None and class_id in class_ids and read_tag(segment, SEGMENT_TAG) == segment_id:
            ids[class_id] = segment_id
    return ids
