"""Segments of the frames of a sequence: those of the frame that is shown are chosen, and seen.

Structures and points are those of the sequence: from frame to frame, they are nearly the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import slicer

from ..classes.class_state import ClassState
from ..interface.message_texts import older_segments_text
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..volumes.opened_volume import OpenedVolume
from ..volumes.volume_content import Frame
from .written_segments import WrittenSegments, choose_segmentation_of, finish_segments


class FrameSegments:
    """Follows a volume from frame to frame.

    Args:
        parameters: say which volume and segmentation.
        volume: as it was opened.
        classes: all, as they are now.
        written: which segments there are of these.
        problems: are told of segments that are older than the classes.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        volume: OpenedVolume,
        classes: Callable[[], Sequence[ClassState]],
        written: WrittenSegments,
        problems: Problems,
    ) -> None:
        self._parameters = parameters
        self._volume = volume
        self._classes = classes
        self._written = written
        self._problems = problems
        self._last: tuple[slicer.vtkMRMLScalarVolumeNode, Frame] | None = None

    def follow(self) -> bool:
        """The volume was handed over anew. Where it is another frame, its segments do not go over those of the one before.

        What was written there of classes that are gone by now stays as it is: they were removed for another frame.

        Returns:
            Whether it is a frame that has segments already.
        """
        volume, content, last = self._parameters.volume, self._volume.content, self._last
        if volume is None or content is None or content.frame is None:
            return False
        self._last = volume, content.frame
        if last is None or last[0] is not volume or last[1].number == content.frame.number:
            return False
        returned = choose_segmentation_of(volume, self._parameters)
        if returned:
            finish_segments(self._parameters.segmentation, [state.id for state in self._classes()])
        return returned

    def tell_of_older(self, returned: bool) -> bool:
        """Tell of segments that are older than what was changed for another frame.

        Args:
            returned: whether the user has come back to a frame that has segments already (`follow`).

        Returns:
            Whether there are such.
        """
        self._problems.solve("older segments")
        older = returned and self._volume.content is not None and self._written.outdated
        if older:
            self._problems.put("older segments", older_segments_text(self._parameters.segmentation.GetName()))
        return older
