"""Classes of the scene as annotation files have them, and back: files speak of a volume as it lies in its own file.

That is the volume's local frame. A transform that the volume is under in the scene moves its points there and back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.classes.annotated_class import AnnotatedClass
from ...core.classes.class_request import check_requests
from ...core.system.errors import InputError
from ...core.volumes.geometry import Geometry, transform_points
from ..mrml.point_lists import Point
from ..mrml.transforms import matrix_to_world
from .class_requests import ClassRequests
from .class_state import ClassState, changed, is_named_by_user, name_beside, new_class_state

SAME_PLACE_MM = 1e-3
"""A transform there and back changes the digits behind."""
SAME_COLOR = 0.01
"""Of each channel: what nobody sees."""


def annotated_classes(states: Sequence[ClassState], asked: ClassRequests, geometry: Geometry) -> list[AnnotatedClass]:
    """What is asked about classes, so that it can be asked again elsewhere and gives the same.

    Args:
        states: the classes.
        asked: what is asked about them. What is not is left out: classes without a point in the volume, and points beyond it.
        geometry: of the volume, in its local frame.

    Raises:
        InputError: nothing is asked, or two classes have one name.
    """
    annotated = []
    for state in states:
        request = asked.of(state.id)
        if request is not None:
            # The box in use: of one that a point enlarged, and that holds none any more, `vittf` would think it a mistake.
            box = request.close_up and request.close_up.enlarged(geometry, request.positive)
            named = replace(request, id=request.name, close_up=box)
            annotated.append(AnnotatedClass(named, state.color, state.look.opacity))
    check_requests([each.request for each in annotated], geometry)
    return annotated


def class_states(
    annotated: Sequence[AnnotatedClass], existing: Sequence[ClassState], volume_node: Any, geometry: Geometry
) -> list[ClassState]:
    """Classes that ask what annotated ones do, as they are to be added to a scene; of boxes only those that are there.

    Those that are in the scene already are left out: the file was loaded twice (`new_among`).

    Args:
        annotated: in the volume's local frame.
        existing: the classes that are in the scene.
        volume_node: which volume.
        geometry: of its voxels, in its local frame.

    Raises:
        InputError: there are none, none that is not there already, two have one name, or a point lies outside the volume, which
            is under a linear transform at most.
    """
    check_requests([each.request for each in annotated], geometry)
    to_world = matrix_to_world(volume_node)
    states = new_among([_class_state(each, to_world) for each in annotated], existing)
    if not states:
        raise InputError("The structures of this file are all there already, with the same points and settings.")
    return states


def new_among(states: Sequence[ClassState], existing: Sequence[ClassState]) -> list[ClassState]:
    """Those of some classes that are not there already, with the same points and settings, as they are to be added.

    Where another class has the name, a number follows; where one has the colour, it is another one. Neither is then of those
    that come with it.
    """
    new: list[ClassState] = []
    for state in states:
        if not any(_are_alike(state, present) for present in existing):
            others = [*existing, *new, *(other for other in states if other is not state)]
            name = name_beside(state.name, {other.name for other in others})
            is_taken = any(np.allclose(state.color, other.color, atol=SAME_COLOR) for other in existing)
            color = new_class_state([*others, state]).color if is_taken else state.color
            new.append(changed(state, name=name, color=color))
    return new


def restored_states(
    annotated: Sequence[AnnotatedClass],
    existing: Sequence[ClassState],
    opened: Sequence[ClassState],
    volume_node: Any,
    geometry: Geometry,
) -> list[ClassState]:
    """All classes that a scene is to have once annotated ones are back.

    Where those were made out of the ones that it was opened with, they take their place. What has been changed or added since
    stays beside them. Where a name is still the same, so are the id, which segments go by, and what files do not say of a
    class.

    Args:
        annotated: see `class_states`.
        existing: the classes that are in the scene.
        opened: those that it was opened with.
        volume_node: see `class_states`.
        geometry: see there.

    Raises:
        InputError: see there.
    """
    names = {each.name for each in annotated}
    to_world = matrix_to_world(volume_node)
    is_made_of_them = _have_something_in_common([_class_state(each, to_world) for each in annotated], opened)
    # Files have no classes without points.
    replaced = [state for state in opened if state in existing and (state.positive or state.name in names)]
    former = {state.name: state for state in replaced} if is_made_of_them else {}
    staying = [state for state in existing if state not in former.values()]
    states = class_states(annotated, staying, volume_node, geometry)
    return [*staying, *(_in_place_of(former[state.name], state) if state.name in former else state for state in states)]


def _have_something_in_common(states: Sequence[ClassState], others: Sequence[ClassState]) -> bool:
    """Whether some classes share a point, or a name that a user gave, with the others.

    If not, they were begun on the scan without those. That both have a "Structure 1" says nothing.
    """
    ones, opposed = (
        np.array([point for state in each for point in (*state.positive, *state.negative)]).reshape(-1, 3)
        for each in (states, others)
    )
    share_a_point = any(np.isclose(opposed, point, rtol=0.0, atol=SAME_PLACE_MM).all(axis=1).any() for point in ones)
    named, others_named = ({state.name for state in each if is_named_by_user(state)} for each in (states, others))
    return share_a_point or not named.isdisjoint(others_named)


def _in_place_of(former: ClassState, state: ClassState) -> ClassState:
    look = replace(former.look, color=state.color, opacity=state.look.opacity)
    return replace(state, id=former.id, look=look, visible=former.visible, continues=former.continues)


def _class_state(annotated: AnnotatedClass, to_world: np.ndarray) -> ClassState:
    request = annotated.request
    box = request.close_up
    state = replace(
        new_class_state([], request.name, annotated.color),
        positive=_points(request.positive, to_world),
        negative=_points(request.negative, to_world),
        iso=request.iso,
        size=request.size,
        proximity=request.proximity,
        refine=request.refine,
        close_up=(*_points(np.array([box.centre_ras]), to_world)[0], *box.size_mm) if box else None,
    )
    return changed(state, opacity=annotated.opacity)


def _are_alike(state: ClassState, other: ClassState) -> bool:
    """Whether the same is asked for two classes, whatever they are called and look like."""
    settings = all(getattr(state, name) == getattr(other, name) for name in ("iso", "size", "proximity", "refine"))
    places = ((each.positive, each.negative, each.close_up or ()) for each in (state, other))
    return settings and all(
        len(ones) == len(others) and np.allclose(ones, others, rtol=0.0, atol=SAME_PLACE_MM)
        for ones, others in zip(*places, strict=True)
    )


def _points(points_ras: np.ndarray, to_world: np.ndarray) -> tuple[Point, ...]:
    """Points (N, 3) of a local frame, in the scene's."""
    return tuple((x, y, z) for x, y, z in transform_points(to_world, points_ras).tolist())
