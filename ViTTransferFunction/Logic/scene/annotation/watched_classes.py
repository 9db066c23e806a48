"""The classes of the chosen volume as they are in the scene, whoever changes them, with undo and redo of each change.

Those of other volumes of the scene wait, with their undo, until their volume is chosen.

It watches the point lists that `class_nodes` describes, so that a point placed, dragged or deleted anywhere in the
application counts as one placed by our tools.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace

import numpy as np
import slicer

from ..classes.class_lists import ClassLists
from ..classes.class_nodes import (
    class_id,
    class_nodes,
    class_nodes_of_all,
    give_to_volume,
    let_negative_follow,
    lists_of,
    negative_node,
    read_class,
    write_class,
    write_classes,
)
from ..classes.class_state import Classes, sharing
from ..classes.history import AnnotationHistory
from ..classes.point_order import PointOrder
from ..classes.volume_histories import VolumeHistories
from ..interface.parameters import referred
from ..mrml.point_list_watch import PointListWatch
from ..mrml.point_lists import index_of_new_point
from ..segments.written_segments import finish_segments_elsewhere


class WatchedClasses:
    """The classes of the chosen volume; while none is chosen, those that belong to no volume.

    Args:
        scene: the scene.
        parameter_node: refers to the volume, and to the classes of all volumes.
        on_change: called after any class or point has changed.
        settle: says where a point that the user has just placed, (3,) RAS millimetres, is to lie; the same array: there.
        on_displayed: called with a list of points that is new, or whose display has changed.
        drawn_together: the context in which many nodes are changed; see the function of that name.

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
        self.restart()

    @property
    def can_undo(self) -> bool:
        """Whether a change of classes or points can be taken back."""
        return self._history.can_undo

    @property
    def can_redo(self) -> bool:
        """Whether a change that was taken back can be made again."""
        return self._history.can_redo

    @property
    def editing(self) -> bool:
        """Whether this object is just changing nodes; it calls `on_change` once that is done."""
        return bool(self._paused)

    @property
    def untouched(self) -> bool:
        """Whether there is no class, and nothing to undo or redo."""
        return not (self.classes or self.can_undo or self.can_redo)

    def undo(self) -> None:
        """Take the last change of classes or points back."""
        self._restore(self._history.undo())

    def redo(self) -> None:
        """Make the change that was taken back last again."""
        self._restore(self._history.redo())

    def restart(self) -> None:
        """Begin again with the classes of another scene; what was done in the one before cannot be undone."""
        self._lists.forget()
        self.refresh()
        self._histories.restart(self.classes)

    def refresh(self) -> None:
        """Read the classes of the volume that is chosen now, and watch their lists.

        If a transform has moved the lists, what was done before cannot be undone.
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
            for node in positive:
                let_negative_follow(node)
            self._lists.show_only(lists)
        if self._lists.have_moved(lists):
            # Undo would put points back where they were in the scene, which is beside a volume that has moved along with them.
            self._histories.begin_anew(self.classes)

    def refresh_and_record(self) -> None:
        """Refresh after something has happened to the lists themselves, as a step for undo.

        It is no such step that a volume was removed and left its classes without one: undo would remove the classes, and not
        bring the volume back.
        """
        if self._paused:
            return
        with self._unheard():
            self._lists.remove_widowed()
        before = self.classes
        self.refresh()
        if not self._histories.volume_id and {state.id for state in self.classes} - {state.id for state in before}:
            self._histories.begin_anew(self.classes)
        self._record(before, None)
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
        """Whether to react to a change of a single list; where many nodes are changed at once, that comes later."""
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
        """A step of its own for undo: what changes little by little before and after it is not joined to it."""
        if self._listens:
            self._changed(None)
            self._history.seal()

    def _on_passing(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        """Maps follow each of many small changes, but undo goes back to before the first."""
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
    def _correct(self) -> Iterator[None]:
        """Change nodes without a step for undo, then react once."""
        with self._unheard():
            yield
        self.refresh()
        self._history.correct(self.classes)
        self._on_change()

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
        self._record(before, kind)

    def _record(self, before: Classes, kind: str | None) -> None:
        if self._history.record(self.classes, kind) or self.classes != before:
            self._on_change()

    def _restore(self, states: Classes) -> None:
        """Bring the scene's classes to `states`."""
        # Below a transform, points come back rounded otherwise, and the next look at them must not be a new step.
        with self._drawn_together(), self._correct():
            write_classes(self._scene, self._parameter_node, states)

    def _give_to_volume(self) -> None:
        """Have the chosen volume get the classes that belong to none yet."""
        volume = referred(self._parameter_node, "volume")
        if volume is not None:
            with self._unheard():
                given = give_to_volume(volume, class_nodes_of_all(self._parameter_node))
            if given:
                finish_segments_elsewhere(volume, [class_id(node) for node in given])
