"""Other segments as what structures are not: points in them that count as negative, but are neither shown nor kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.volumes.geometry import Geometry, transform_points
from ..classes.class_state import ClassState
from ..classes.of_volume import volume_of
from ..mrml.transforms import matrix_to_world
from .labelmaps import labelmaps_of
from .segment_points import SegmentPoints
from .segment_tags import CORRECTED_TAG, read_tag, segments_of_classes
from .written_segments import written_classes

POINTS_OF_A_SEGMENT = 3
"""Enough to tell what is typical of it, and few enough for a whole body's hundred segments."""


def outside_points(segmentation_node: Any, states: Sequence[ClassState], points: SegmentPoints) -> dict[str, np.ndarray]:
    """Points off each class, by its id, (N, 3) RAS millimetres: points in the visible segments of others.

    Segments of the classes themselves do not count, nor those of classes that were removed. Nor does, for a class, a segment
    that holds one of its positive points: a lesion was clicked within a liver, an organ within a body.

    Args:
        segmentation_node: whose segments.
        states: the classes.
        points: knows them; those that are still being searched for are missing.

    Raises:
        InputError: the segmentation is under a non-linear transform.
    """
    segmentation = segmentation_node.GetSegmentation()
    classes = {state.id for state in states} | written_classes(segmentation_node, volume_of(segmentation_node))
    ours = set(segments_of_classes(segmentation, classes).values())
    others = [id_ for id_ in segmentation.GetSegmentIDs() if id_ not in ours and _is_visible(segmentation_node, id_)]
    clicked = _clicked(segmentation_node, others, states)
    outside: dict[str, list[np.ndarray]] = {state.id: [] for state in states}
    for segment_id in others:
        found = points.of(segmentation_node, segment_id, POINTS_OF_A_SEGMENT)
        corrected = read_tag(segmentation.GetSegment(segment_id), CORRECTED_TAG)
        if found is not None:
            for state in states:
                if segment_id not in clicked[state.id] and state.id != corrected:
                    outside[state.id].append(found)
    return {id_: np.concatenate([np.empty((0, 3)), *found]) for id_, found in outside.items()}


def _is_visible(segmentation_node: Any, segment_id: str) -> bool:
    display = segmentation_node.GetDisplayNode()
    return display is None or bool(display.GetVisibility() and display.GetSegmentVisibility(segment_id))


def _clicked(segmentation_node: Any, segment_ids: Sequence[str], states: Sequence[ClassState]) -> dict[str, set[str]]:
    """For each class, the segments that one of its positive points lies in."""
    to_segmentation = np.linalg.inv(matrix_to_world(segmentation_node))
    clicked: dict[str, set[str]] = {state.id: set() for state in states}
    for labelmap in labelmaps_of(segmentation_node.GetSegmentation(), segment_ids):
        voxels, geometry = labelmap.voxels, labelmap.geometry
        for state in states:
            positive = transform_points(to_segmentation, np.array(state.positive).reshape(-1, 3))
            there = set(_labels_at(voxels, geometry, positive).tolist())
            clicked[state.id] |= {segment_id for segment_id, label in labelmap.labels.items() if label in there}
    return clicked


def _labels_at(labels: np.ndarray, geometry: Geometry, points_ras: np.ndarray) -> np.ndarray:
    """The labels of the voxels that points (N, 3) lie in, of those within the grid."""
    nearest = geometry.nearest_voxels(points_ras[geometry.contains(points_ras)])
    there: np.ndarray = labels[tuple(nearest.T)]
    return there
