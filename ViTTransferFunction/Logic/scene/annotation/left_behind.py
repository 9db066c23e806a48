"""Points that stayed where they are in the scene while their volume was moved: they lie elsewhere in it now.

A volume may be moved while another one is chosen, as registering the one to the other does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import slicer

from ...core.system.errors import InputError
from ..classes.volume_histories import Classes
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..interface.wording import left_behind_text
from ..mrml.point_lists import Point
from ..mrml.transforms import matrix_to_world
from ..volumes.volume_content import content_of
from .annotations import SceneAnnotations

_SAME_MM = 1e-4
"""A voxel to the next has not moved by less: a transform that is hardened is rounded otherwise."""

_Points = dict[str, tuple[tuple[Point, ...], tuple[Point, ...]]]
"""Positive and negative ones, by the id of their class; of classes that have some."""


@dataclass(frozen=True, eq=False)
class _Look:
    """What there was of a volume at a moment: its voxels, where these are in the scene, and the points.

    Attributes:
        voxels: see `VolumeContent`.
        ijk_to_world: where they are.
        points: all of them.
        home: where the voxels were when those that are left were placed.
        left: points that did not go along.
    """

    voxels: tuple[Any, int]
    ijk_to_world: np.ndarray
    points: _Points
    home: np.ndarray
    left: _Points


class LeftBehind:
    """Tells which structures' points did not go along with a volume, until they follow, are changed, or it comes back.

    Args:
        parameters: say which volume.
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
        self._tell(volume, now.left if now is not None else {})
        return self._problems.standing != before

    def forget(self) -> None:
        """The scene is another one, in which nothing was moved."""
        self._last.clear()

    def _look(self, volume: slicer.vtkMRMLScalarVolumeNode) -> _Look | None:
        try:
            content = content_of(volume)
        except InputError:
            return None
        last, points = self._last.get(volume), _points(self._annotations.classes)
        ijk_to_world = matrix_to_world(volume) @ content.geometry.ijk_to_ras
        home, left = ijk_to_world, _Points()
        if last is not None and last.voxels == content.voxels:
            home, left = last.home, last.left
            if not _is_same(last.ijk_to_world, ijk_to_world):
                left = left | {id_: stayed for id_, stayed in points.items() if last.points.get(id_) == stayed}
            if _is_same(home, ijk_to_world):
                left = {}
            left = {id_: stayed for id_, stayed in left.items() if points.get(id_) == stayed}
        return _Look(content.voxels, ijk_to_world, points, home if left else ijk_to_world, left)

    def _tell(self, volume: slicer.vtkMRMLScalarVolumeNode | None, left: _Points) -> None:
        if volume is not None and left:
            names = [state.name for state in self._annotations.classes if state.id in left]
            self._problems.put("left behind", left_behind_text(volume.GetName(), names))
        else:
            self._problems.solve("left behind")


def _points(classes: Classes) -> _Points:
    return {state.id: (state.positive, state.negative) for state in classes if state.positive or state.negative}


def _is_same(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.allclose(one, other, rtol=0.0, atol=_SAME_MM))
