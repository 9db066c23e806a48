"""From classes in the scene to what the compute process has to know of them: points in the volume's own frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from ...core.classes.class_request import ClassRequest
from ...core.classes.close_up import CloseUp
from ...core.volumes.geometry import Geometry, transform_points
from ...core.volumes.missing_intensity import without_intensity
from ..mrml.point_lists import Point
from ..mrml.transforms import matrix_to_world
from ..volumes.volume_content import VolumeContent
from .class_state import ClassState, CloseUpBox

Points = Sequence[Point] | np.ndarray
"""(N, 3) RAS millimetres of the scene."""


@dataclass(frozen=True, eq=False)
class ClassRequests:
    """What is asked for, and what is not.

    Attributes:
        requests: of each class that has a positive point in the volume.
        points_beyond: how many of the user's points lie beyond the volume and do not count, by class id; of classes that have
            some.
        points_without_intensity: how many of the positive points in the volume lie where that has no intensity, by class id; of
            classes that have some.
    """

    requests: list[ClassRequest] = field(default_factory=list)
    points_beyond: dict[str, int] = field(default_factory=dict)
    points_without_intensity: dict[str, int] = field(default_factory=dict)

    def of(self, id_: str) -> ClassRequest | None:
        """The request of a class; None where it has no positive point in the volume."""
        return next((request for request in self.requests if request.id == id_), None)


def class_requests(
    states: Sequence[ClassState], more_negative: Mapping[str, np.ndarray], volume_node: Any, content: VolumeContent
) -> ClassRequests:
    """The requests of classes; nothing about colour or visibility.

    Args:
        states: the classes.
        more_negative: by class id, further points off it, (N, 3) RAS millimetres of the scene.
        volume_node: which volume.
        content: what it holds.

    Raises:
        InputError: the volume is under a non-linear transform.
    """
    found = ClassRequests()
    to_local = np.linalg.inv(matrix_to_world(volume_node))
    groups = [(state.positive, state.negative, more_negative.get(state.id, ())) for state in states]
    inside = iter(_inside([points for group in groups for points in group], to_local, content.geometry))
    for state, positive, negative, more in zip(states, inside, inside, inside, strict=True):
        beyond = len(state.positive) + len(state.negative) - len(positive) - len(negative)
        if beyond:
            found.points_beyond[state.id] = beyond
        if missing := without_intensity(content.array, content.geometry, positive):
            found.points_without_intensity[state.id] = missing
        if len(positive):
            found.requests.append(
                ClassRequest(
                    state.id,
                    positive,
                    np.concatenate([negative, more]),
                    iso=state.iso,
                    size=state.size,
                    proximity=state.proximity,
                    refine=state.refine,
                    close_up=_local_close_up(to_local, state.close_up),
                    name=_printable(state.name),
                )
            )
    return found


def _printable(name: str) -> str:
    """A name as messages have it: a list of points may be called anything, and saved scenes and segments bring theirs."""
    return "".join(character if character.isprintable() else " " for character in name).strip()


def _local_close_up(to_local: np.ndarray, close_up: CloseUpBox | None) -> CloseUp | None:
    """A class's close-up in the volume's frame, along whose axes its edges are."""
    if close_up is None:
        return None
    x, y, z = transform_points(to_local, np.array(close_up[:3]))[0].tolist()
    return CloseUp((x, y, z), close_up[3:])


def _inside(lists: Sequence[Points], to_local: np.ndarray, geometry: Geometry) -> list[np.ndarray]:
    """Of each list the points in the volume, (N, 3) in its frame. Found of all lists at once: a click waits for it."""
    arrays = [np.array(points, dtype=np.float64).reshape(-1, 3) for points in lists]
    points = transform_points(to_local, np.concatenate([np.empty((0, 3)), *arrays]))
    inside = geometry.contains(points)
    starts = np.cumsum([0, *map(len, arrays)])
    return [points[start:end][inside[start:end]] for start, end in pairwise(starts)]
