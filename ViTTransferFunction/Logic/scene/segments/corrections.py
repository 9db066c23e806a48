"""Segments of ours whose voxels somebody changed since they were written: by hand in the Segment Editor, or by a script."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from ...core.volumes.stepped_work import Steps
from ...core.volumes.voxel_digest import VoxelDigest, voxel_digests
from .labelmaps import labelmaps_of
from .segment_tags import VOXELS_TAG, read_tag

Corrections = Literal["keep", "overwrite"]
"""What becomes of corrected segments when their classes are written again: they stay, and the results are written beside them
as new segments; or they get the results."""


def corrected_segments(segmentation: Any, segments: Mapping[str, str]) -> Steps[dict[str, str]]:
    """Which segments are not as they were written; in steps. One without a note of what was written counts as corrected.

    Args:
        segmentation: vtkSegmentation with binary labelmaps.
        segments: segment IDs, by class id.

    Returns:
        Those of `segments` that were corrected.
    """
    # Segments may be deleted between two steps.
    noted = {segment_id: _noted(segmentation.GetSegment(segment_id)) for segment_id in segments.values()}
    found: dict[str, VoxelDigest] = {}
    for labelmap in labelmaps_of(segmentation, segments.values()):
        digests = yield from voxel_digests(labelmap.voxels, labelmap.geometry, labelmap.labels.values())
        found.update({segment_id: digests[label] for segment_id, label in labelmap.labels.items()})
    return {
        class_id: segment_id
        for class_id, segment_id in segments.items()
        if not found.get(segment_id, VoxelDigest.of_nothing()).is_like(noted[segment_id])
    }


def _noted(segment: Any | None) -> VoxelDigest | None:
    return VoxelDigest.from_text(read_tag(segment, VOXELS_TAG) or "") if segment is not None else None
