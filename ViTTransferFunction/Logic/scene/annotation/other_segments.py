"""Segments that others made, as a help while clicking: a class continues one, and the others are what structures are not."""

from __future__ import annotations

from typing import Any

import numpy as np
import slicer

from ...core.system.errors import InputError
from ..classes.class_state import Classes, ClassState
from ..interface.parameters import SceneParameters
from ..segments.labelmaps import LABELMAP
from ..segments.outside_points import outside_points
from ..segments.segment_points import SegmentPoints
from .annotations import SceneAnnotations

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
        self._continued: list[tuple[Any, str]] = []

    @property
    def busy(self) -> bool:
        """Whether `advance` has something to do."""
        return self._points.busy

    def advance(self) -> bool:
        """Search for points in segments for some milliseconds; returns whether all that were asked for are known."""
        return self._points.advance()

    def choose_continued(self, segment_id: str) -> None:
        """Choose a segment for `begin_continued`; those that were chosen before come first."""
        chosen = self._parameters.segmentation, segment_id
        if chosen[0] is not None and chosen not in self._continued:
            self._continued.append(chosen)

    def drop_continued(self) -> None:
        """Begin none of those that were chosen: another volume is, and they lie in the one before."""
        self._continued.clear()

    def begin_continued(self, annotations: SceneAnnotations) -> ClassState | None:
        """Add a class with the name and colour of the segment that was chosen first, and points in it.

        Returns:
            The class; None where no segment is left, or its points are still being searched for.

        Raises:
            InputError: the segment cannot be continued.
        """
        while self._continued:
            node, segment_id = chosen = self._continued.pop(0)
            segment = node.GetSegmentation().GetSegment(segment_id)
            if not self._scene.IsNodePresent(node) or segment is None:
                continue
            points = self._points.of(node, segment_id, CONTINUED_POINTS)
            if points is None:
                self._continued.insert(0, chosen)
                return None
            name = segment.GetName()
            if not len(points):
                raise _without_points(node.GetSegmentation(), name)
            return annotations.continue_segment(segment_id, name, segment.GetColor(), points)
        return None

    def outside(self, states: Classes) -> dict[str, np.ndarray]:
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
        self._continued.clear()


def _without_points(segmentation: Any, name: str) -> InputError:
    """Why no point was found in a segment."""
    if segmentation.ContainsRepresentation(LABELMAP):
        return InputError(f"The segment '{name}' is empty, so no structure was added from it. Choose another one.")
    return InputError(
        f"The segment '{name}' is stored as '{segmentation.GetSourceRepresentationName()}'; expected '{LABELMAP}', so no "
        "structure was added from it. In Slicer's module Segmentations, under Representations, press Create beside "
        f"'{LABELMAP}', and choose it again."
    )
