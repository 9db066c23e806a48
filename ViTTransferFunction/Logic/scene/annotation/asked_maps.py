"""What the compute process was asked for last: maps of the classes as they are."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compute.proxy import SegmentationProxy
from ...core.system.errors import InputError
from ..classes.class_requests import ClassRequests, class_requests
from ..classes.class_state import Classes
from ..interface.parameters import SceneParameters
from ..segments.outside_points import outside_points
from ..segments.segment_points import SegmentPoints
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .selected_class import SelectedClass


class AskedMaps:
    """Asks for maps, and knows what was asked.

    Args:
        parameters: say which volume and segmentation, how maps are refined, and whether other segments count as outside.
        annotations: hold the classes.
        selected: is asked for first.
        volume: that the compute process has.
        segment_points: searches for points in other segments.
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
        segment_points: SegmentPoints,
        proxy: SegmentationProxy,
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._selected = selected
        self._volume = volume
        self._segment_points = segment_points
        self._proxy = proxy
        self._asked: tuple[Any, ...] | None = None
        self.requests = ClassRequests()

    def ask(self) -> None:
        """Ask for maps, unless what they depend on is as it was when they were asked for last."""
        node, content, classes = self._parameters.volume, self._volume.content, self._annotations.classes
        self.requests = ClassRequests()
        if node is not None and content is not None:
            self.requests = class_requests(classes, self._outside(classes), node, content)
        asked = (self.requests.requests, self._parameters.refinement())
        if asked != self._asked:
            self._asked = asked
            selected = self._selected.state
            self._proxy.update(*asked, first=selected.id if selected else "")

    def forget(self) -> None:
        """The compute process has another volume, of which nothing was asked."""
        self._asked = None

    def _outside(self, classes: Classes) -> dict[str, np.ndarray]:
        """Points off each class, by its id (`outside_points`); none if other segments do not count as outside."""
        node = self._parameters.segmentation
        if node is None or not self._parameters.get("otherSegmentsAreOutside"):
            return {}
        try:
            return outside_points(node, classes, self._segment_points)
        except InputError:  # Its transform is not linear; who writes segments into it is told.
            return {}
