"""Segments that others made, as a help while clicking: a class continues one, and the others are what structures are not."""

from __future__ import annotations

from typing import Any

import numpy as np
import slicer

from ..core.errors import InputError
from .annotations import SceneAnnotations
from .classes import ClassState
from .outside_points import outside_points
from .parameters import SceneParameters
from .segment_points import SegmentPoints

CONTINUED_POINTS = 5
"""Points that a class begins with which continues a segment: those of a user who clicks with care."""


class OtherSegments:
    """Of the chosen segmentation.

    Args:
        scene: the scene.
        parameters: say which segmentation, and whether its segments count as outside.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, parameters: SceneParameters) -> None:
        self._scene = scene
        self._parameters = parameters
        self._points = SegmentPoints(scene)
        self._continued: tuple[Any, str] | None = None

    @property
    def busy(self) -> bool:
        """Whether `advance` has something to do."""
        return self._points.busy

    def advance(self) -> bool:
        """Search for points in segments for some milliseconds; returns whether all that were asked for are known."""
        return self._points.advance()

    def choose_continued(self, segment_id: str) -> None:
        """Choose a segment for `begin_continued`."""
        if self._parameters.segmentation is not None:
            self._continued = self._parameters.segmentation, segment_id

    def begin_continued(self, annotations: SceneAnnotations) -> ClassState | None:
        """Add a class with the chosen segment's name, colour, and points in it, once they are known; None until then.

        Raises:
            InputError: the segment cannot be continued.
        """
        if self._continued is None:
            return None
        (node, segment_id), self._continued = self._continued, None
        segment = node.GetSegmentation().GetSegment(segment_id)
        if not self._scene.IsNodePresent(node) or segment is None:
            return None
        points = self._points.of(node, segment_id, CONTINUED_POINTS)
        if points is None:
            self._continued = node, segment_id
            return None
        name = segment.GetName()
        if not len(points):
            raise InputError(f"The segment '{name}' is empty, so no structure was added from it. Choose another one.")
        return annotations.continue_segment(segment_id, name, segment.GetColor(), points)

    def outside(self, states: tuple[ClassState, ...]) -> dict[str, np.ndarray]:
        """Points off each class, by its id (`outside_points`); none where the user does not want them."""
        node = self._parameters.segmentation
        if node is None or not self._parameters.get("otherSegmentsAreOutside"):
            return {}
        try:
            return outside_points(node, states, self._points)
        except InputError:  # Its transform is not linear, which whoever writes into it is told.
            return {}

    def forget(self) -> None:
        """The scene is another one."""
        self._points.forget()
        self._continued = None
