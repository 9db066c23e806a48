"""Points and segments that stayed where they are in the scene while their volume was moved: they lie elsewhere in it now.

A volume may be moved while another one is chosen, as registering the one to the other does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import slicer

from ...core.system.errors import InputError
from ..classes.class_state import PointsByClass, points_by_class
from ..interface.message_texts import left_behind_text
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..mrml.transforms import matrix_to_world
from ..segments.labelmaps import labelmaps_of
from ..segments.segment_tags import segments_of_classes
from ..volumes.volume_content import content_of
from .annotations import SceneAnnotations

_SAME_MM = 1e-4
"""A voxel to the next has not moved by less: a transform that is hardened is rounded otherwise."""


@dataclass(frozen=True, eq=False)
class _Look:
    """What there was of a volume at a moment: its voxels, where these are in the scene, and the points.

    Attributes:
        voxels: see `VolumeContent`.
        ijk_to_world: where they are.
        points: all of them.
        segments_to_world: where voxels of the classes' segments are; None where there are none.
        home: where the voxels were when what is left was made.
        left: points that did not go along.
        segments_are_left: whether the segments did not.
    """

    voxels: tuple[Any, int]
    ijk_to_world: np.ndarray
    points: PointsByClass
    segments_to_world: np.ndarray | None
    home: np.ndarray
    left: PointsByClass
    segments_are_left: bool


class LeftBehind:
    """Tells which points and segments did not go along with a volume, until they follow, are changed, or it comes back.

    Args:
        parameters: say which volume and segmentation.
        annotations: hold the points.
        problems: are told.
    """

    def __init__(self, parameters: SceneParameters, annotations: SceneAnnotations, problems: Problems) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._problems = problems
        self._last: dict[slicer.vtkMRMLScalarVolumeNode, _Look] = {}

    def look(self) -> bool:
        """Compare with the last look at the volume; between two, what is moved together may be moved one after the other.

        Returns:
            Whether there is something new to tell, or what was told is over.
        """
        before, volume = self._problems.standing, self._parameters.volume
        self._last = {node: last for node, last in self._last.items() if node.GetScene() is not None}
        now = self._look(volume) if volume is not None else None
        if now is not None:
            self._last[volume] = now
        self._tell(now)
        return self._problems.standing != before

    def forget(self) -> None:
        """The scene is another one, in which nothing was moved."""
        self._last.clear()

    def _look(self, volume: slicer.vtkMRMLScalarVolumeNode) -> _Look | None:
        try:
            content = content_of(volume)
        except InputError:
            return None
        ijk_to_world = matrix_to_world(volume) @ content.geometry.ijk_to_ras
        points, segments_to_world = points_by_class(self._annotations.classes), self._segments_to_world()
        now = _Look(content.voxels, ijk_to_world, points, segments_to_world, ijk_to_world, PointsByClass(), False)
        last = self._last.get(volume)
        return now if last is None or last.voxels != now.voxels else _compared(now, last)

    def _segments_to_world(self) -> np.ndarray | None:
        node = self._parameters.segmentation
        if node is None:
            return None
        ids = segments_of_classes(node.GetSegmentation(), {state.id for state in self._annotations.classes})
        labelmaps = labelmaps_of(node.GetSegmentation(), ids.values())
        if not labelmaps:
            return None
        try:
            # The grid stays where it is while segments are edited on it.
            return np.asarray(matrix_to_world(node) @ labelmaps[0].grid_to_local)
        except InputError:
            return None

    def _tell(self, now: _Look | None) -> None:
        volume, segmentation = self._parameters.volume, self._parameters.segmentation
        if now is None or volume is None or not (now.left or now.segments_are_left):
            self._problems.solve("left behind")
            return
        names = [state.name for state in self._annotations.classes if state.id in now.left]
        left_segmentation = segmentation.GetName() if now.segments_are_left and segmentation is not None else None
        self._problems.put("left behind", left_behind_text(volume.GetName(), names, left_segmentation))


def _compared(now: _Look, last: _Look) -> _Look:
    """What was seen now, with what is left behind since the last look or one before; the voxels are the same."""
    if _is_same(last.home, now.ijk_to_world):
        return now
    moved = not _is_same(last.ijk_to_world, now.ijk_to_world)
    may_be_left = last.points if moved else last.left
    left = {id_: stayed for id_, stayed in may_be_left.items() if now.points.get(id_) == stayed}
    segments_are_left = (moved or last.segments_are_left) and _segments_stayed_behind(now, last)
    return replace(now, home=last.home, left=left, segments_are_left=segments_are_left) if left or segments_are_left else now


def _segments_stayed_behind(now: _Look, last: _Look) -> bool:
    """Whether segments are where they were, and the volume is not. Those moved first are where the volume is by now."""
    if last.segments_to_world is None or now.segments_to_world is None:
        return False
    stayed = _is_same(last.segments_to_world, now.segments_to_world)
    # Segments have voxels of the volume's grid.
    return stayed and not _is_same(now.segments_to_world, now.ijk_to_world)


def _is_same(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.allclose(one, other, rtol=0.0, atol=_SAME_MM))
