"""Points that stayed where they are in the scene while their volume was moved: they lie elsewhere in it now."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import slicer

from ..core.errors import InputError
from .annotations import Classes, SceneAnnotations
from .parameters import SceneParameters
from .point_lists import Point
from .problems import Problems
from .volume import matrix_to_world
from .volume_content import content_of
from .wording import left_behind_text

_SAME_MM = 1e-4
"""A voxel to the next has not moved by less: a transform that is hardened is rounded otherwise."""

_Points = dict[str, tuple[tuple[Point, ...], tuple[Point, ...]]]
"""Positive and negative ones, by the id of their class; of classes that have some."""


@dataclass(frozen=True, eq=False)
class _Look:
    """What there was at a moment: a volume and its voxels, where these are in the scene, and the points."""

    volume: slicer.vtkMRMLScalarVolumeNode
    voxels: tuple[Any, int]
    ijk_to_world: np.ndarray
    points: _Points


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
        self._last: _Look | None = None
        self._home: np.ndarray | None = None
        self._left: _Points = {}

    def look(self) -> bool:
        """Compare with the last look; between two, what is moved together may be moved one after the other.

        Returns:
            Whether there is something new to tell, or what was told is over.
        """
        before = self._problems.standing
        last, self._last = self._last, self._look()
        now = self._last
        if last is None or now is None or last.volume is not now.volume or last.voxels != now.voxels:
            self._left, self._home = {}, None
        elif not _is_same(last.ijk_to_world, now.ijk_to_world):
            self._home = last.ijk_to_world if self._home is None else self._home
            stayed = {id_: points for id_, points in now.points.items() if last.points.get(id_) == points}
            self._left = {} if _is_same(self._home, now.ijk_to_world) else self._left | stayed
        if now is not None:
            self._left = {id_: points for id_, points in self._left.items() if now.points.get(id_) == points}
        self._tell()
        return self._problems.standing != before

    def _look(self) -> _Look | None:
        volume = self._parameters.volume
        if volume is None:
            return None
        try:
            content = content_of(volume)
        except InputError:
            return None
        ijk_to_world = matrix_to_world(volume) @ content.geometry.ijk_to_ras
        return _Look(volume, content.voxels, ijk_to_world, _points(self._annotations.classes))

    def _tell(self) -> None:
        if self._left and self._last is not None:
            names = [state.name for state in self._annotations.classes if state.id in self._left]
            self._problems.put("left behind", left_behind_text(self._last.volume.GetName(), names))
        else:
            self._home = None
            self._problems.solve("left behind")


def _points(classes: Classes) -> _Points:
    return {state.id: (state.positive, state.negative) for state in classes if state.positive or state.negative}


def _is_same(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.allclose(one, other, rtol=0.0, atol=_SAME_MM))
