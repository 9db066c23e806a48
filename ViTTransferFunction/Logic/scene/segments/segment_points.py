"""Points that stand for segments, found a little at a time, and found anew only where voxels have changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import slicer

from ...core.classes.label_points import points_in_label
from ...core.volumes.geometry import Box, transform_points
from ...core.volumes.stepped_work import SteppedWork, Steps
from ...core.volumes.voxel_digest import label_boxes
from ..mrml.transforms import matrix_to_world
from .labelmaps import LABELMAP, Labelmap, labelmaps_of

_Key = tuple[str, str, int]
_State = tuple[int, int]


class SegmentPoints:
    """Knows points of the segments that it was asked about.

    Args:
        scene: whose segmentations they are of.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._scene = scene
        self._found: dict[_Key, tuple[_State, np.ndarray]] = {}
        self._wanted: list[_Key] = []
        self._work: tuple[_Key, _State, SteppedWork[np.ndarray]] | None = None
        self._boxes: dict[Any, tuple[int, dict[int, Box]]] = {}

    def of(self, segmentation_node: Any, segment_id: str, count: int) -> np.ndarray | None:
        """About `count` points well inside a segment, (N, 3) RAS millimetres of the scene; none where it has no voxels.

        None where they are not known yet: then `advance` will find them.

        Raises:
            InputError: the segmentation is under a non-linear transform.
        """
        key = segmentation_node.GetID(), segment_id, count
        state, points = self._found.get(key, (None, None))
        if points is not None and state == _state(segmentation_node, segment_id):
            return transform_points(matrix_to_world(segmentation_node), points)
        if key not in self._wanted and (self._work is None or self._work[0] != key):
            self._wanted.append(key)
        return None

    @property
    def busy(self) -> bool:
        """Whether `advance` has something to do."""
        return self._work is not None or bool(self._wanted)

    def advance(self) -> bool:
        """Search for some milliseconds; returns whether points of all segments that were asked about have been found."""
        self._begin_anew_where_changed()
        if self._work is None and not self._begin():
            self._boxes.clear()
            return True
        assert self._work is not None
        (key, state, work), self._work = self._work, None  # What a defect raises is raised once.
        if not work.advance():
            self._work = key, state, work
        elif work.result is not None:
            self._found[key] = state, work.result
        if not self.busy:
            self._boxes.clear()
        return not self.busy

    def forget(self) -> None:
        """Stop, and forget everything: the scene is another one."""
        self._found.clear()
        self._wanted.clear()
        self._boxes.clear()
        self._work = None

    def _begin_anew_where_changed(self) -> None:
        """Where the segment is another one since the search began: its voxels may be gone between two steps."""
        if self._work is not None:
            key, state, _ = self._work
            node_id, segment_id, _ = key
            node = self._node_with(node_id, segment_id)
            if node is None or _state(node, segment_id) != state:
                self._work = None
                self._wanted.insert(0, key)

    def _begin(self) -> bool:
        """Take up the next segment that is still there."""
        while self._wanted:
            key = node_id, segment_id, count = self._wanted.pop(0)
            node = self._node_with(node_id, segment_id)
            if node is not None:
                self._work = key, _state(node, segment_id), SteppedWork(self._search(node.GetSegmentation(), segment_id, count))
                return True
        return False

    def _node_with(self, node_id: str, segment_id: str) -> Any:
        """The segmentation; None where it, or the segment in it, is gone."""
        node = self._scene.GetNodeByID(node_id)
        return node if node is not None and node.GetSegmentation().GetSegment(segment_id) is not None else None

    def _search(self, segmentation: Any, segment_id: str, count: int) -> Steps[np.ndarray]:
        for labelmap in labelmaps_of(segmentation, [segment_id]):
            boxes = yield from self._boxes_in(labelmap)
            label = labelmap.labels[segment_id]
            if label in boxes:
                return (yield from points_in_label(labelmap.voxels, label, boxes[label], labelmap.geometry, count))
        return np.empty((0, 3))

    def _boxes_in(self, labelmap: Labelmap) -> Steps[dict[int, Box]]:
        """The boxes of all labels, which are found once for all segments that share the labelmap."""
        time = labelmap.image.GetMTime()
        known, boxes = self._boxes.get(labelmap.image, (-1, {}))
        if known != time:
            boxes = yield from label_boxes(labelmap.voxels)
            self._boxes[labelmap.image] = time, boxes
        return boxes


def _state(segmentation_node: Any, segment_id: str) -> _State:
    """What a segment's voxels are told by, without the image: VTK counts the modifications of all images together."""
    segment = segmentation_node.GetSegmentation().GetSegment(segment_id)
    image = segment.GetRepresentation(LABELMAP)
    return image.GetMTime() if image else 0, segment.GetLabelValue()
