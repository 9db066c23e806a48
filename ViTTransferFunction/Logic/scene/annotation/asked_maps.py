"""What the compute process was asked for last: maps of the classes as they are."""

from __future__ import annotations

from typing import Any

from ...compute.proxy import SegmentationProxy
from ..classes.class_requests import ClassRequests, class_requests
from ..interface.parameters import SceneParameters
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .other_segments import OtherSegments
from .selected_class import SelectedClass


class AskedMaps:
    """Asks for maps, and knows what was asked.

    Args:
        parameters: say which volume, and how maps are refined.
        annotations: hold the classes.
        selected: is asked for first.
        volume: that the compute process has.
        other_segments: where they count as outside.
        proxy: is asked.

    Attributes:
        requests: of the classes as they were at the last call of `ask`.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        selected: SelectedClass,
        volume: OpenedVolume,
        other_segments: OtherSegments,
        proxy: SegmentationProxy,
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._selected = selected
        self._volume = volume
        self._other_segments = other_segments
        self._proxy = proxy
        self._asked: tuple[Any, ...] | None = None
        self.requests = ClassRequests()

    def ask(self) -> None:
        """Ask for maps, unless what they depend on is as it was when they were asked for last."""
        node, content, classes = self._parameters.volume, self._volume.content, self._annotations.classes
        self.requests = ClassRequests()
        if node is not None and content is not None:
            self.requests = class_requests(classes, self._other_segments.outside(classes), node, content)
        asked = (self.requests.requests, self._parameters.refinement())
        if asked != self._asked:
            self._asked = asked
            selected = self._selected.state
            self._proxy.update(*asked, first=selected.id if selected else "")

    def forget(self) -> None:
        """The compute process has another volume, of which nothing was asked."""
        self._asked = None
