"""What users do to the classes and points of the chosen volume with this module's tools, step by step for undo."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import slicer

from ...core.classes.class_request import check_name, composed
from ...core.classes.colors import Color
from ...core.system.errors import InputError
from ..classes.class_nodes import (
    class_id,
    class_nodes,
    create_class,
    negative_node,
    order_classes,
    remove_class,
    write_class,
    write_classes,
)
from ..classes.class_size import stepped, turned
from ..classes.class_state import (
    Classes,
    ClassState,
    CloseUpBox,
    begun_anew,
    changed,
    duplicate_class_state,
    new_class_state,
    without_points,
)
from ..mrml.point_lists import Point
from .watched_classes import WatchedClasses


class SceneAnnotations(WatchedClasses):
    """Edits classes. The base class notices what users change in the same point lists elsewhere, in views or other modules."""

    _brought: Classes = ()
    """The classes as `bring_along` left them."""

    def add_class(self, name: str | None = None, color: Color | None = None) -> ClassState:
        """Add a class without points."""
        state = new_class_state(self.classes, name, color)
        with self._edit():
            create_class(self._scene, self._parameter_node, state)
        return state

    def add_classes(self, states: Sequence[ClassState]) -> None:
        """Add classes after the others; those with an id that is there already replace that class. One step for undo."""
        self.set_classes(_put_among(states, self.classes))

    def set_classes(self, states: Sequence[ClassState]) -> None:
        """Replace all classes by these; one step for undo."""
        with self._edit():
            write_classes(self._scene, self._parameter_node, states)

    def bring_along(self, states: Sequence[ClassState]) -> None:
        """Add the classes of other volumes without their points, to annotate the same structures here; one step for undo.

        Of several with the same name, the first is added.
        """
        by_name = {state.name: state for state in reversed(states)}
        self.add_classes([without_points(state) for state in states if state is by_name[state.name]])
        self._brought = self.classes

    def leave(self) -> Callable[[], None]:
        """Prepare for another volume to be chosen; returns a function to call once it is.

        It removes the classes that `bring_along` added to this volume, unless users have changed any class since.
        """
        brought = class_nodes(self._parameter_node) if self.classes == self._brought else []
        volume_id = self._histories.volume_id

        def remove_brought() -> None:
            if brought and self._histories.volume_id != volume_id:
                with self._unheard():
                    for node in brought:
                        remove_class(self._scene, node)
                self._histories.forget(volume_id)

        return remove_brought

    def duplicate_class(self, id_: str) -> ClassState:
        """Add a copy of a class below it, with the same settings and points.

        As long as both have the same points, the upper one gets the voxels.
        """
        state = duplicate_class_state(self.classes, self._class(id_))
        ids = [present.id for present in self.classes]
        with self._edit():
            create_class(self._scene, self._parameter_node, state)
            ids.insert(ids.index(id_) + 1, state.id)
            order_classes(self._parameter_node, ids)
        return state

    def move_class(self, id_: str, step: int) -> None:
        """Move a class `step` places down, or up if negative; no further than the ends.

        Segments are written in this order, and a voxel that two classes claim alike goes to the upper one.
        """
        ids = [state.id for state in self.classes]
        place = ids.index(id_)
        ids.insert(max(place + step, 0), ids.pop(place))
        with self._edit():
            order_classes(self._parameter_node, ids)

    def continue_segment(self, segment_id: str, name: str, color: Color, points_ras: np.ndarray) -> ClassState:
        """Add a class that begins with positive points (N, 3) in a segment, RAS millimetres; one step for undo."""
        state = new_class_state(self.classes, name, color)
        state = replace(state, positive=_as_points(points_ras), continues=segment_id)
        with self._edit():
            create_class(self._scene, self._parameter_node, state)
        return state

    def remove_class(self, id_: str) -> None:
        """Remove a class and its points. Its segment, if it was written, stays until segments are written again."""
        with self._edit():
            remove_class(self._scene, self._positive(id_))

    def set_class(self, id_: str, **fields: Any) -> None:
        """Change fields of a class (see `ClassState`), or of its look (see `Appearance`).

        All steps of a slider that is being dragged are one step for undo. While an iso value is fixed, the size is 0.

        Raises:
            InputError: the name is empty, cannot be written, or is another class's.
        """
        state = changed(self._class(id_), **fields)
        # The list of its points may have been given any name, in the Data module, and the rest is to be set all the same.
        if "name" in fields:
            state = replace(state, name=_usable_name(state.name, {other.name for other in self.classes if other.id != id_}))
        if state.iso is not None:
            state = replace(state, size=0.0)
        with self._edit(kind=f"{id_} {' '.join(sorted(fields))}"):
            self._write(state)

    def set_close_up(self, id_: str, close_up: CloseUpBox | None) -> None:
        """Set the box in which a class is looked at by itself; None: in the whole volume. See `ClassState`."""
        with self._edit():
            self._write(replace(self._class(id_), close_up=close_up))

    def move_close_ups(self, close_ups: Mapping[str, CloseUpBox]) -> None:
        """Move the boxes of classes, by class id, after a transform has moved what is in them. Neither is a step for undo."""
        with self._correct():
            for id_, close_up in close_ups.items():
                self._write(replace(self._class(id_), close_up=close_up))

    def step_size(self, id_: str, direction: Literal[-1, 1]) -> None:
        """Make a class one step smaller (−1) or larger (1)."""
        with self._edit():
            self._write(stepped(self._class(id_), direction))

    def turn_size(self, id_: str, notches: int) -> None:
        """Make a class larger, or smaller if negative, by notches of the wheel; several in a row are one step for undo."""
        with self._edit(kind=f"{id_} wheel"):
            self._write(turned(self._class(id_), notches))

    def points_node(self, id_: str, positive: bool) -> slicer.vtkMRMLMarkupsFiducialNode:
        """The list that the user places a class's points in."""
        node = self._positive(id_)
        points = node if positive else negative_node(node)
        if points is None or points.GetDisplayNode() is None:
            with self._edit():  # The user deleted it, or what displays it, without which it takes no clicks; it is made again.
                self._write(self._class(id_))
        return node if positive else negative_node(node)

    def add_points(self, id_: str, points_ras: np.ndarray, positive: bool, continued: bool = False) -> None:
        """Add points (N, 3) to a class, RAS millimetres; `continued`: as part of the previous step for undo.

        A hidden class is shown again, so that the effect of the points is seen.
        """
        field = "positive" if positive else "negative"
        with self._edit(f"{id_} {field}", continued):
            self._grow(id_, {field: points_ras})

    def add_points_of_both(self, id_: str, positive_ras: np.ndarray, negative_ras: np.ndarray) -> None:
        """Add positive points (N, 3) and negative points (M, 3), RAS millimetres, as one step for undo; see `add_points`."""
        with self._edit():
            self._grow(id_, {"positive": positive_ras, "negative": negative_ras})

    def erase_points(self, points_ras: np.ndarray, radius_mm: float, continued: bool = False) -> None:
        """Remove the points of visible classes that lie within `radius_mm` of one of `points_ras` (N, 3)."""
        with self._edit("erase", continued):
            for state in self.classes:
                if state.visible:
                    positive, negative = (_outside(p, points_ras, radius_mm) for p in (state.positive, state.negative))
                    left = replace(state, positive=positive, negative=negative)
                    if left != state:
                        self._write(left)

    def remove_last_point(self, id_: str) -> None:
        """Remove the point of a class that was placed last, positive or negative."""
        state = self._class(id_)
        last = self._order.last(state)
        if last is not None:
            with self._edit():
                self._write(replace(state, **{last: getattr(state, last)[:-1]}))

    def remove_points(self, id_: str) -> None:
        """Remove all points of a class, and reset what was set because of them: size, iso value, close-up; one step for undo.

        It keeps its name, look and segment, and is shown again if it was hidden.
        """
        with self._edit():
            self._write(begun_anew(self._class(id_)))

    def _grow(self, id_: str, points_ras: Mapping[str, np.ndarray]) -> None:
        state = self._class(id_)
        grown = {field: getattr(state, field) + _as_points(points) for field, points in points_ras.items()}
        self._write(replace(state, visible=True, **grown))

    def _write(self, state: ClassState) -> None:
        """Bring the class with the id of `state` to that state in the scene; to be called within an edit."""
        write_class(self._scene, self._positive(state.id), state)

    def _class(self, id_: str) -> ClassState:
        return next(state for state in self.classes if state.id == id_)

    def _positive(self, id_: str) -> slicer.vtkMRMLMarkupsFiducialNode:
        return next(node for node in class_nodes(self._parameter_node) if class_id(node) == id_)


def _put_among(states: Sequence[ClassState], present: Classes) -> Classes:
    by_id = {state.id: state for state in (*present, *states)}
    return tuple(by_id.values())


def _usable_name(name: str, taken: Collection[str]) -> str:
    """The name that a class gets if a user types this one. Raises InputError if it cannot be used."""
    name = name.strip()
    if not name:
        raise InputError("A structure needs a name; it keeps the one that it had.")
    check_name(name)
    if composed(name) in map(composed, taken):
        raise InputError(f"There is a structure called '{name}' already; this one keeps the name that it had.")
    return name


def _as_points(points_ras: np.ndarray) -> tuple[Point, ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points_ras)


def _outside(points: tuple[Point, ...], centres_ras: np.ndarray, radius_mm: float) -> tuple[Point, ...]:
    """The points that lie further than `radius_mm` from every centre."""
    return tuple(p for p in points if np.linalg.norm(centres_ras - np.array(p), axis=1).min() > radius_mm)
