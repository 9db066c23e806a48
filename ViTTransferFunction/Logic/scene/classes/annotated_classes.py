"""Converts between classes of the scene and those of annotation files.

Files use the volume's local coordinate frame, as in its own file. In the scene, points are in world coordinates, to which the
volume may have a transform.
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
"""Points that are closer than this are the same: transforming them there and back causes rounding errors."""
SAME_COLOR = 0.01
"""Colours are the same if no channel differs by more than this, which is invisible."""


def annotated_classes(states: Sequence[ClassState], asked: ClassRequests, geometry: Geometry) -> list[AnnotatedClass]:
    """Classes for an annotation file, such that their requests, made elsewhere, give the same maps.

    Args:
        states: the classes.
        asked: the requests for their maps. These lack classes without a point in the volume, and points outside it.
        geometry: of the volume, in its local frame.

    Raises:
        InputError: there are no requests, or two classes have the same name.
    """
    annotated = []
    for state in states:
        request = asked.of(state.id)
        if request is not None:
            # Enlarged as points outside it require: the original may contain no point, which `vittf` would report as a mistake.
            box = request.close_up and request.close_up.enlarged(geometry, request.positive)
            named = replace(request, id=request.name, close_up=box)
            annotated.append(AnnotatedClass(named, state.color, state.look.opacity))
    check_requests([each.request for each in annotated], geometry)
    return annotated


def class_states(
    annotated: Sequence[AnnotatedClass], existing: Sequence[ClassState], volume_node: Any, geometry: Geometry
) -> list[ClassState]:
    """Classes of an annotation file, to be added to a scene.

    Classes that the scene has already are left out, in case the file is loaded twice (`new_among`).

    Args:
        annotated: the classes of the file, in the volume's local frame.
        existing: the classes of the scene.
        volume_node: the volume.
        geometry: of its voxels, in its local frame.

    Raises:
        InputError: there are no classes, the scene has all of them already, two have the same name, a point lies outside the
            volume, or the volume is under a transform that is not linear.
    """
    check_requests([each.request for each in annotated], geometry)
    to_world = matrix_to_world(volume_node)
    states = new_among([_class_state(each, to_world) for each in annotated], existing)
    if not states:
        raise InputError("The structures of this file are all there already, with the same points and settings.")
    return states


def new_among(states: Sequence[ClassState], existing: Sequence[ClassState]) -> list[ClassState]:
    """The new ones among some classes, to be added; a class with the same points and settings as an existing one is not new.

    A number is appended to names that are taken, and colours that are taken are replaced. The new names and colours differ from
    those of all other classes, those that are added with them included.
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
    """All classes of a scene after the classes of an annotation file are restored.

    If these were made from the classes with which the scene was opened, they replace them. Classes that have been changed or
    added since are kept beside them. A class that replaces one of the same name keeps its id, to which segments refer, and
    everything that files do not contain.

    Args:
        annotated: see `class_states`.
        existing: the classes that are in the scene.
        opened: the classes with which it was opened.
        volume_node: see `class_states`.
        geometry: see there.

    Raises:
        InputError: see there.
    """
    names = {each.name for each in annotated}
    to_world = matrix_to_world(volume_node)
    is_made_of_them = _have_something_in_common([_class_state(each, to_world) for each in annotated], opened)
    # Classes without points are not in files.
    replaced = [state for state in opened if state in existing and (state.positive or state.name in names)]
    former = {state.name: state for state in replaced} if is_made_of_them else {}
    staying = [state for state in existing if state not in former.values()]
    states = class_states(annotated, staying, volume_node, geometry)
    return [*staying, *(_in_place_of(former[state.name], state) if state.name in former else state for state in states)]


def _have_something_in_common(states: Sequence[ClassState], others: Sequence[ClassState]) -> bool:
    """Whether some classes share a point, or a name that a user gave, with the others.

    If not, they were begun independently of each other. Default names such as "Structure 1" do not count.
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
    """Whether two classes have the same points and settings, whatever their names and looks."""
    settings = all(getattr(state, name) == getattr(other, name) for name in ("iso", "size", "proximity", "refine"))
    places = ((each.positive, each.negative, each.close_up or ()) for each in (state, other))
    return settings and all(
        len(ones) == len(others) and np.allclose(ones, others, rtol=0.0, atol=SAME_PLACE_MM)
        for ones, others in zip(*places, strict=True)
    )


def _points(points_ras: np.ndarray, to_world: np.ndarray) -> tuple[Point, ...]:
    """Points (N, 3) transformed from the local frame to world coordinates."""
    return tuple((x, y, z) for x, y, z in transform_points(to_world, points_ras).tolist())
