"""The classes of a volume as the user edits them: by this object or in the views, with undo and redo for either.

Those of other volumes of the scene wait, with their undo, until their volume is chosen.

It watches the point lists that `classes` describes, so that a point placed, dragged or deleted anywhere in the
application counts as one placed here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import slicer

from ..core.class_request import check_name
from ..core.colors import Color
from ..core.errors import InputError
from .class_lists import ClassLists
from .class_size import stepped, turned
from .class_state import ClassState, CloseUpBox, changed, duplicate_class_state, new_class_state, sharing, without_points
from .classes import (
    class_id,
    class_nodes,
    class_nodes_of_all,
    create_class,
    give_to_volume,
    lists_of,
    negative_node,
    order_classes,
    read_class,
    remove_class,
    write_class,
    write_classes,
)
from .history import AnnotationHistory
from .parameters import referred
from .point_list_watch import PointListWatch
from .point_lists import Point, index_of_new_point
from .point_order import PointOrder
from .volume_histories import Classes, VolumeHistories
from .written_segments import finish_segments_elsewhere


class SceneAnnotations:
    """The classes of the volume that is chosen; while none is, those that belong to none.

    Args:
        scene: the scene.
        parameter_node: refers to the volume, and to the classes of all volumes.
        on_change: called after any class or point has changed.
        settle: says where a point that the user has just placed, (3,) RAS millimetres, is to lie: itself, or elsewhere.
        on_displayed: called with a list of points that is new, or displayed otherwise.
        drawn_together: in which many nodes are changed; see the function of that name.

    Attributes:
        classes: as they are now, in order.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        parameter_node: slicer.vtkMRMLScriptedModuleNode,
        on_change: Callable[[], None],
        settle: Callable[[np.ndarray], np.ndarray] = lambda point_ras: point_ras,
        on_displayed: Callable[[slicer.vtkMRMLMarkupsFiducialNode], None] = lambda points: None,
        drawn_together: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._scene = scene
        self._parameter_node = parameter_node
        self._on_change = on_change
        self._settle = settle
        self._drawn_together = drawn_together
        self._watch = PointListWatch(self._on_placed, self._on_step, self._on_passing, on_displayed)
        self._paused = 0
        self._order = PointOrder()
        self._lists = ClassLists(scene, parameter_node)
        self._histories = VolumeHistories()
        self.classes: Classes = ()
        self._brought: Classes = ()
        self.restart()

    def add_class(self, name: str | None = None, color: Color | None = None) -> ClassState:
        """Add a class without points."""
        state = new_class_state(self.classes, name, color)
        with self._edit():
            create_class(self._scene, self._parameter_node, state)
        return state

    def add_classes(self, states: Sequence[ClassState]) -> None:
        """Add classes with all that they have, after the others, or bring those that are there to it; one step for undo."""
        self.set_classes(_put_among(states, self.classes))

    def set_classes(self, states: Sequence[ClassState]) -> None:
        """Have these classes, with all that they have, and no others; one step for undo."""
        with self._edit():
            write_classes(self._scene, self._parameter_node, states)

    def bring_along(self, states: Sequence[ClassState]) -> None:
        """Add classes for the same structures, which were made on another volume, without their points; one step for undo."""
        self.add_classes([without_points(state) for state in states])
        self._brought = self.classes

    def leave(self) -> Callable[[], None]:
        """The volume is about to be left; returns what is to be called when another one is chosen.

        That removes what `bring_along` brought, where the user did nothing about it: as if nobody had been there.
        """
        brought = class_nodes(self._parameter_node) if self._brought and self.classes == self._brought else []
        volume_id = self._histories.volume_id

        def remove_brought() -> None:
            if brought and self._histories.volume_id != volume_id:
                with self._unheard():
                    for node in brought:
                        remove_class(self._scene, node)
                self._histories.forget(volume_id)

        return remove_brought

    def duplicate_class(self, id_: str) -> ClassState:
        """Add a class with the same settings and points below a class.

        Where both have the same points, the voxels stay with the upper one.
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
        ids.insert(min(max(place + step, 0), len(ids) - 1), ids.pop(place))
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

        The steps of a slider being dragged count as one for undo. A fixed iso value takes the place of the size.

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
            write_class(self._scene, self._positive(id_), state)

    def set_close_up(self, id_: str, close_up: CloseUpBox | None) -> None:
        """Have a class looked at in a box of the volume, or in the whole (None); see `ClassState`."""
        with self._edit():
            write_class(self._scene, self._positive(id_), replace(self._class(id_), close_up=close_up))

    def move_close_ups(self, close_ups: Mapping[str, CloseUpBox]) -> None:
        """Have boxes elsewhere, by class id, since a transform has moved what is in them: no step for undo, as that is none."""
        with self._unheard():
            for id_, close_up in close_ups.items():
                write_class(self._scene, self._positive(id_), replace(self._class(id_), close_up=close_up))
        self.refresh()
        self._history.correct(self.classes)
        self._on_change()

    def step_size(self, id_: str, direction: Literal[-1, 1]) -> None:
        """Make a class one step smaller (−1) or larger (1)."""
        with self._edit():
            write_class(self._scene, self._positive(id_), stepped(self._class(id_), direction))

    def turn_size(self, id_: str, notches: int) -> None:
        """Make a class larger, or smaller, by notches of the wheel; those in a row count as one for undo."""
        with self._edit(kind=f"{id_} wheel"):
            write_class(self._scene, self._positive(id_), turned(self._class(id_), notches))

    def points_node(self, id_: str, positive: bool) -> slicer.vtkMRMLMarkupsFiducialNode:
        """The list that the user places a class's points in."""
        node = self._positive(id_)
        if not positive and negative_node(node) is None:
            with self._edit():  # The user deleted it; it is made again.
                write_class(self._scene, node, self._class(id_))
        return node if positive else negative_node(node)

    def add_points(self, id_: str, points_ras: np.ndarray, positive: bool, continued: bool = False) -> None:
        """Add points (N, 3) to a class, RAS millimetres; `continued`: together with the ones before, one step for undo.

        A hidden class is shown again: whoever adds to it is to see what that does.
        """
        field = "positive" if positive else "negative"
        with self._edit(f"{id_} {field}", continued):
            self._grow(id_, {field: points_ras})

    def add_points_of_both(self, id_: str, positive_ras: np.ndarray, negative_ras: np.ndarray) -> None:
        """As `add_points`, positive ones (N, 3) and negative ones (M, 3), which together are one step for undo."""
        with self._edit():
            self._grow(id_, {"positive": positive_ras, "negative": negative_ras})

    def erase_points(self, points_ras: np.ndarray, radius_mm: float, continued: bool = False) -> None:
        """Remove the points of visible classes that lie within `radius_mm` of one of `points_ras` (N, 3)."""
        with self._edit("erase", continued):
            for state in self.classes:
                if state.visible:
                    positive, negative = (_outside(p, points_ras, radius_mm) for p in (state.positive, state.negative))
                    write_class(self._scene, self._positive(state.id), replace(state, positive=positive, negative=negative))

    def remove_last_point(self, id_: str) -> None:
        """Remove the point of a class that was placed last, positive or negative."""
        state = self._class(id_)
        last = self._order.last(state)
        if last is not None:
            with self._edit():
                write_class(self._scene, self._positive(id_), replace(state, **{last: getattr(state, last)[:-1]}))

    @property
    def continued(self) -> bool:
        """Whether the last change belongs to the step for undo before it, as each point of a stroke but the first does."""
        return self._history.continued

    @property
    def can_undo(self) -> bool:
        """Whether a change of classes or points can be taken back."""
        return self._history.can_undo

    @property
    def can_redo(self) -> bool:
        """Whether a change that was taken back can be made again."""
        return self._history.can_redo

    @property
    def untouched(self) -> bool:
        """Whether there is no class, and nothing was done since the scene was opened that left none."""
        return not (self.classes or self.can_undo or self.can_redo)

    def undo(self) -> None:
        """Take the last change of classes or points back."""
        self._restore(self._history.undo())

    def redo(self) -> None:
        """Make the change that was taken back last again."""
        self._restore(self._history.redo())

    def restart(self) -> None:
        """Begin anew with what is in the scene: it is another one, and what was done in the one before cannot be undone."""
        self._lists.forget()
        self.refresh()
        self._histories.restart(self.classes)

    def refresh(self) -> None:
        """Read the classes anew, and watch the lists that are there now; where another volume is chosen, it is others.

        Where a transform has moved them, what was done before cannot be undone.
        """
        self._give_to_volume()
        positive = class_nodes(self._parameter_node)
        before, known = self.classes, {state.id: state for state in self.classes}
        self.classes = tuple(sharing(read_class(node), known.get(class_id(node))) for node in positive)
        volume = referred(self._parameter_node, "volume")
        if not self._histories.follow(volume.GetID() if volume is not None else "", before, self.classes):
            self._order.note(before, self.classes)
        lists = [node for each in positive for node in lists_of(each)]
        self._watch.watch(lists)
        with self._unheard():
            self._lists.show_only(lists)
        if self._lists.have_moved(lists):
            # Undo knows places in the scene: where a transform has moved lists, with the volume say, it would lead beside it.
            self._histories.begin_anew(self.classes)

    def refresh_and_record(self) -> None:
        """As `refresh`, where something happened to the lists themselves; it can be undone."""
        if not self._paused:
            with self._unheard():
                self._lists.remove_widowed()
            self._changed(None)
            self._histories.keep(lambda id_: self._scene.GetNodeByID(id_) is not None)

    @property
    def observer_count(self) -> int:
        """How many observers of point lists there are."""
        return self._watch.observer_count

    def close(self) -> None:
        """Stop watching."""
        self._watch.close()

    @property
    def _history(self) -> AnnotationHistory[Classes]:
        return self._histories.current

    @property
    def _listens(self) -> bool:
        """Whether what happens to a list counts by itself; where many nodes are changed at once, that comes later."""
        return not (self._paused or self._scene.IsBatchProcessing())

    def _on_placed(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        if not self._listens:
            return
        known = {point for state in self.classes for point in (*state.positive, *state.negative)}
        index = index_of_new_point(points, known)
        if index is not None:
            placed = np.array(points.GetNthControlPointPositionWorld(index))
            settled = self._settle(placed)
            if settled is not placed:
                with self._unheard():
                    points.SetNthControlPointPositionWorld(index, *settled)
        self._show_class_of(points)
        self._on_step(points)

    def _show_class_of(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        for positive in class_nodes(self._parameter_node):
            state = read_class(positive)
            if points in (positive, negative_node(positive)) and not state.visible:
                with self._unheard():
                    write_class(self._scene, positive, replace(state, visible=True))

    def _on_step(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        """What passes before and after belongs to other steps."""
        if self._listens:
            self._changed(None)
            self._history.seal()

    def _on_passing(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        """Maps follow, but undo goes back to where it began."""
        if self._listens:
            self._changed("passing")

    @contextmanager
    def _edit(self, kind: str | None = None, continued: bool = True) -> Iterator[None]:
        """Change nodes without reacting to every single step, then react once."""
        if not continued:
            self._history.seal()
        with self._drawn_together():
            with self._unheard():
                yield
            self._changed(kind)

    @contextmanager
    def _unheard(self) -> Iterator[None]:
        """Change nodes without reacting to it."""
        self._paused += 1
        try:
            yield
        finally:
            self._paused -= 1

    def _changed(self, kind: str | None) -> None:
        before = self.classes
        self.refresh()
        if self._history.record(self.classes, kind) or self.classes != before:
            self._on_change()

    def _restore(self, states: Classes) -> None:
        """Bring the scene's classes to `states`."""
        with self._drawn_together():
            with self._unheard():
                write_classes(self._scene, self._parameter_node, states)
            self.refresh()
            # Below a transform, points come back rounded otherwise: without this, the next look at them would be a new step.
            self._history.correct(self.classes)
            self._on_change()

    def _give_to_volume(self) -> None:
        """Have the chosen volume get the classes that belong to none yet."""
        volume = referred(self._parameter_node, "volume")
        if volume is not None:
            with self._unheard():
                given = give_to_volume(volume, class_nodes_of_all(self._parameter_node))
            if given:
                finish_segments_elsewhere(volume, [class_id(node) for node in given])

    def _grow(self, id_: str, points_ras: Mapping[str, np.ndarray]) -> None:
        state = self._class(id_)
        grown = {field: getattr(state, field) + _as_points(points) for field, points in points_ras.items()}
        write_class(self._scene, self._positive(id_), replace(state, visible=True, **grown))

    def _class(self, id_: str) -> ClassState:
        return next(state for state in self.classes if state.id == id_)

    def _positive(self, id_: str) -> slicer.vtkMRMLMarkupsFiducialNode:
        return next(node for node in class_nodes(self._parameter_node) if class_id(node) == id_)


def _put_among(states: Sequence[ClassState], present: Classes) -> Classes:
    by_id = {state.id: state for state in (*present, *states)}
    return tuple(by_id.values())


def _usable_name(name: str, taken: Collection[str]) -> str:
    """A name that a user has typed, as the class gets it. Raises InputError where it cannot have it."""
    name = name.strip()
    if not name:
        raise InputError("A structure needs a name; it keeps the one that it had.")
    check_name(name)
    if name in taken:
        raise InputError(f"There is a structure called '{name}' already; this one keeps the name that it had.")
    return name


def _as_points(points_ras: np.ndarray) -> tuple[Point, ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points_ras)


def _outside(points: tuple[Point, ...], centres_ras: np.ndarray, radius_mm: float) -> tuple[Point, ...]:
    """The points that lie further than `radius_mm` from every centre."""
    return tuple(p for p in points if np.linalg.norm(centres_ras - np.array(p), axis=1).min() > radius_mm)
