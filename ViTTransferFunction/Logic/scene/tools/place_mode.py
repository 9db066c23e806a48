"""Slicer's own way to place points: it works in every slice and 3D view, and users know it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import slicer
import vtk

from ..classes.class_nodes import LIST_CLASS, is_list_of_a_class
from ..mrml.observers import SceneObservers


@dataclass(frozen=True)
class _Placing:
    """What Slicer places, and whether it goes on after each point."""

    list_class: str | None
    list_id: str | None
    persistence: int


class PlaceMode:
    """Lets the user place points in a list until somebody ends it; then Slicer places what it placed before.

    Args:
        app_logic: the application's logic, which knows the nodes that decide what the mouse does.
        on_ended: called when the user ended it in a view, or another tool took the mouse.
    """

    def __init__(self, app_logic: Any, on_ended: Callable[[], None]) -> None:
        self._selection = app_logic.GetSelectionNode()
        self._interaction = app_logic.GetInteractionNode()
        self._on_ended = on_ended
        self._before: _Placing | None = None
        self._list_id = ""
        self._observers = SceneObservers()

    def start(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        """Have clicks in the views add points to `points`, one after the other; also where Slicer has their number fixed.

        That is a lock of its module Markups, against clicks by mistake: a click there places nothing, and ends placing.
        """
        self._observers.remove_all()
        if self._before is None:
            self._before = self._placing()
        self._list_id = points.GetID()
        points.SetFixedNumberOfControlPoints(False)
        self._selection.SetReferenceActivePlaceNodeClassName(LIST_CLASS)
        self._selection.SetActivePlaceNodeID(self._list_id)
        self._interaction.SetPlaceModePersistence(1)
        self._interaction.SetCurrentInteractionMode(slicer.vtkMRMLInteractionNode.Place)
        self._watch()

    def stop(self) -> None:
        """Give the mouse back to the views."""
        if self._before is not None:
            self._restore()
            self._interaction.SwitchToViewTransformMode()

    def end_unfinished(self) -> None:
        """End what a saved scene or the module Markups began: clicks go into a structure's list while no tool is in hand."""
        node = self._selection.GetScene().GetNodeByID(self._selection.GetActivePlaceNodeID() or "")
        if self._before is not None or node is None or not is_list_of_a_class(node):
            return
        self._selection.SetActivePlaceNodeID(None)
        if self._interaction.GetCurrentInteractionMode() == slicer.vtkMRMLInteractionNode.Place:
            self._interaction.SetPlaceModePersistence(0)
            self._interaction.SwitchToViewTransformMode()

    def _placing(self) -> _Placing:
        selection, persistence = self._selection, self._interaction.GetPlaceModePersistence()
        list_class, list_id = selection.GetActivePlaceNodeClassName(), selection.GetActivePlaceNodeID()
        node = selection.GetScene().GetNodeByID(list_id or "")
        # Slicer begins to place points in each list that is made, and so in a structure's.
        return _Placing(list_class, None if node is None or is_list_of_a_class(node) else list_id, persistence)

    def _watch(self) -> None:
        mode_changed = slicer.vtkMRMLInteractionNode.InteractionModeChangedEvent
        self._observers.observe(self._interaction, [(mode_changed, self._on_changed)])
        self._observers.observe(self._selection, [("ModifiedEvent", self._on_changed)])
        scene = self._selection.GetScene()
        self._observers.observe(scene, [(scene.NodeAboutToBeRemovedEvent, self._on_node_going)])

    def _on_changed(self, caller: Any, event: str) -> None:
        placing = self._interaction.GetCurrentInteractionMode() == slicer.vtkMRMLInteractionNode.Place
        if not placing or self._selection.GetActivePlaceNodeID() != self._list_id:
            self._restore()
            self._on_ended()

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def _on_node_going(self, caller: vtk.vtkObject, event: str, node: Any) -> None:
        """End before the list is gone: Slicer's tool bar then goes on placing in another one, perhaps another structure's."""
        if node.GetID() == self._list_id:
            self.stop()
            self._on_ended()

    def _restore(self) -> None:
        """Undo what `start` did, as far as nobody has changed it since: another tool may place its own points by now."""
        self._observers.remove_all()
        before, self._before = self._before, None
        assert before is not None
        if self._interaction.GetPlaceModePersistence():
            self._interaction.SetPlaceModePersistence(before.persistence)
        if self._selection.GetActivePlaceNodeID() == self._list_id:
            # Otherwise Slicer's own button would go on to place points in this structure.
            self._selection.SetReferenceActivePlaceNodeClassName(before.list_class or "")
            self._selection.SetActivePlaceNodeID(before.list_id)
