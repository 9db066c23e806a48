"""Begins classes from segments that were made elsewhere, so that the user can improve them by clicks."""

from __future__ import annotations

from typing import Any

import slicer

from ...core.system.errors import InputError
from ..classes.class_state import ClassState
from ..interface.notices import Notices
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..segments.labelmaps import LABELMAP
from ..segments.segment_points import SegmentPoints
from .annotations import SceneAnnotations
from .selected_class import SelectedClass

CONTINUED_POINTS = 5
"""Number of points that such a class begins with: about as many as a user who clicks with care sets."""


class ContinuedSegments:
    """Begins a class from each segment that the user chooses, as soon as points in the segment have been found.

    Args:
        scene: the scene.
        parameters: say which segmentation is chosen.
        annotations: get the classes.
        selected: is set to each class that is begun.
        points: searches for points in segments.
        problems: are told of segments that cannot be continued.
        notices: front ends are told of these, and that segments were chosen.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        selected: SelectedClass,
        points: SegmentPoints,
        problems: Problems,
        notices: Notices,
    ) -> None:
        self._scene = scene
        self._parameters = parameters
        self._annotations = annotations
        self._selected = selected
        self._points = points
        self._problems = problems
        self._notices = notices
        self._chosen: list[tuple[Any, str]] = []  # Segmentation and id of each segment, in the order of their choice.
        self._refused = False

    @property
    def busy(self) -> bool:
        """Whether `begin` has something to do, although no search for points has finished: it stopped at a refused segment."""
        return self._refused

    def choose(self, segment_id: str) -> None:
        """Choose a segment of the chosen segmentation. Its class begins now if points in it are known, or by `begin`."""
        chosen = self._parameters.segmentation, segment_id
        if chosen[0] is not None and chosen not in self._chosen:
            self._chosen.append(chosen)
        self.begin()
        self._notices.tell()

    def begin(self) -> None:
        """Begin classes from the chosen segments in order, up to the first one whose points are still being searched for.

        At a segment that cannot be continued, the user is told why, and the segments after it are left to the next call.
        """
        self._refused = False
        try:
            while (begun := self._begin_next()) is not None:
                self._selected.select(begun.id)
        except InputError as error:
            self._problems.put("segments", str(error))
            self._notices.tell()
            self._refused = True

    def forget(self) -> None:
        """Begin no class from the segments that were chosen: another volume or another scene is open now."""
        self._chosen.clear()

    def _begin_next(self) -> ClassState | None:
        """Add a class with the name and colour of the segment that was chosen first, and points in it.

        Returns:
            The class; None if no segment is left, or points in the first one are still being searched for.

        Raises:
            InputError: the segment cannot be continued; it is no longer among the chosen ones.
        """
        while self._chosen:
            node, segment_id = chosen = self._chosen.pop(0)
            segment = node.GetSegmentation().GetSegment(segment_id)
            if not self._scene.IsNodePresent(node) or segment is None:
                continue
            points = self._points.of(node, segment_id, CONTINUED_POINTS)
            if points is None:
                self._chosen.insert(0, chosen)
                return None
            name = segment.GetName()
            if not len(points):
                raise _without_points(node.GetSegmentation(), name)
            return self._annotations.continue_segment(segment_id, name, segment.GetColor(), points)
        return None


def _without_points(segmentation: Any, name: str) -> InputError:
    """The error for a segment in which no point was found."""
    if segmentation.ContainsRepresentation(LABELMAP):
        return InputError(f"The segment '{name}' is empty, so no structure was added from it. Choose another one.")
    return InputError(
        f"The segment '{name}' is stored as '{segmentation.GetSourceRepresentationName()}'; expected '{LABELMAP}', so no "
        "structure was added from it. In Slicer's module Segmentations, under Representations, press Create beside "
        f"'{LABELMAP}', and choose it again."
    )
