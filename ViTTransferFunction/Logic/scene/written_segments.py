"""What was written into a segmentation, as its node notes it: by attributes, which are saved with the scene alone.

By these, segments whose classes were removed in this scene are told from finished ones that came in a file of segments, which
have no such note and are somebody else's.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any
from urllib.parse import quote, unquote

from .segment_tags import segments_of_classes

CLASSES_ATTRIBUTE = "ViTTransferFunction.writtenClasses"
"""Ids of all classes that were ever written there, percent-encoded, with spaces between."""


def note_written(segmentation_node: Any, class_ids: Collection[str]) -> None:
    """Note that classes were written."""
    ids = written_classes(segmentation_node) | set(class_ids)
    segmentation_node.SetAttribute(CLASSES_ATTRIBUTE, " ".join(sorted(quote(id_, safe="") for id_ in ids)))


def written_classes(segmentation_node: Any) -> set[str]:
    """Ids of all classes that were ever written there."""
    return {unquote(id_) for id_ in (segmentation_node.GetAttribute(CLASSES_ATTRIBUTE) or "").split()}


def left_segments(segmentation_node: Any, present: Collection[str]) -> dict[str, str]:
    """IDs of the segments that were written for classes which are not `present` any more, by class."""
    return segments_of_classes(segmentation_node.GetSegmentation(), written_classes(segmentation_node) - set(present))
