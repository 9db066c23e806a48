"""The scan that points were placed on, as its volume's node notes it: where the node shows another one, the user is told.

A saved scene refers to a scan's file, which may have been replaced by another patient's since. While a scene is open, whoever
changes voxels does it on purpose.
"""

from __future__ import annotations

from collections.abc import Collection

import slicer

from ...core.volumes.thumbnail import Thumbnail
from ..classes.class_attributes import attribute, set_attribute
from ..classes.class_state import PointsByClass, points_by_class
from ..interface.message_texts import other_scan_text
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..volumes.opened_volume import OpenedVolume
from ..volumes.volume_content import VolumeContent
from .annotations import SceneAnnotations

_THUMBNAIL = "thumbnail"
"""Attribute of a volume that has points: `Thumbnail` of what these were placed on."""


class ScanOfPoints:
    """Notes what a volume shows where points are placed on it, and tells of points that were placed on something else.

    It is told until these points are changed or gone. Whoever goes on, by placing a point, is not told again when the scene is
    opened next.

    Args:
        parameters: say which volume.
        annotations: hold the points.
        volume: as it was opened.
        problems: are told.
    """

    def __init__(
        self, parameters: SceneParameters, annotations: SceneAnnotations, volume: OpenedVolume, problems: Problems
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._volume = volume
        self._problems = problems
        self._of_others: dict[slicer.vtkMRMLScalarVolumeNode, PointsByClass] = {}  # Of volumes that were looked at.

    @property
    def thumbnail(self) -> Thumbnail | None:
        """Of what the points of the chosen volume were placed on; None: not known."""
        node, content = self._parameters.volume, self._volume.content
        if node is None or content is None or content.thumbnail is None:
            return None
        return _noted(node) or content.thumbnail

    def look(self) -> bool:
        """Compare the chosen volume with what its points were placed on, or note what it shows.

        Returns:
            Whether there is something new to tell, or what was told is over.
        """
        before, node, content = self._problems.standing, self._parameters.volume, self._volume.content
        self._of_others = {known: points for known, points in self._of_others.items() if known.GetScene() is not None}
        of_others = PointsByClass()
        if node is not None and content is not None:
            points = points_by_class(self._annotations.classes)
            if node not in self._of_others:
                noted = _noted(node)
                self._of_others[node] = points if noted is not None and not _may_be(noted, content) else {}
            of_others = {id_: ones for id_, ones in self._of_others[node].items() if points.get(id_) == ones}
            self._of_others[node] = of_others
            if not of_others or of_others != points:
                _note(node, content.thumbnail if points else None)
        if of_others:
            self._problems.put("other scan", other_scan_text(node.GetName()))
        else:
            self._problems.solve("other scan")
        return self._problems.standing != before

    def add(self, ids: Collection[str], placed_on: Thumbnail | None) -> None:
        """Classes were added to the chosen volume whose points were placed on this; None: not known."""
        node, content = self._parameters.volume, self._volume.content
        if placed_on is not None and content is not None and not _may_be(placed_on, content):
            added = {id_: ones for id_, ones in points_by_class(self._annotations.classes).items() if id_ in ids}
            self._of_others[node] = self._of_others.get(node, {}) | added
            _note(node, placed_on)
            self._problems.solve("other scan")  # Those that were told of before are other points: it is told again.

    def forget(self) -> None:
        """The scene is another one, whose volumes may have come from other files."""
        self._of_others.clear()


def _may_be(thumbnail: Thumbnail, content: VolumeContent) -> bool:
    return content.thumbnail is None or thumbnail.may_be_of(content.array, content.geometry)


def _noted(node: slicer.vtkMRMLScalarVolumeNode) -> Thumbnail | None:
    return Thumbnail.from_text(attribute(node, _THUMBNAIL) or "")


def _note(node: slicer.vtkMRMLScalarVolumeNode, thumbnail: Thumbnail | None) -> None:
    text = None if thumbnail is None else thumbnail.to_text()
    if attribute(node, _THUMBNAIL) != text:
        set_attribute(node, _THUMBNAIL, text)
