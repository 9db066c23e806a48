"""Slicer's own way to place points: it works in every slice and 3D view, and users know it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import slicer


class PlaceMode:
    """Lets the user place points in a list until somebody ends it.

    Args:
        app_logic: the application's logic, which knows the nodes that decide what the mouse does.
        on_ended: called when the user ended it in a view, or another tool took the mouse.
    """

    def __init__(self, app_logic: Any, on_ended: Callable[[], None]) -> None:
        self._selection = app_logic.GetSelectionNode()
        self._interaction = app_logic.GetInteractionNode()
        self._on_ended = on_ended
        self._tag: int | None = None

    def start(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        """Have clicks in the views add points to `points`, one after the other."""
        self._stop_watching()
        self._selection.SetReferenceActivePlaceNodeClassName("vtkMRMLMarkupsFiducialNode")
        self._selection.SetActivePlaceNodeID(points.GetID())
        self._interaction.SetPlaceModePersistence(1)
        self._interaction.SetCurrentInteractionMode(slicer.vtkMRMLInteractionNode.Place)
        event = slicer.vtkMRMLInteractionNode.InteractionModeChangedEvent
        self._tag = self._interaction.AddObserver(event, self._on_mode_changed)

    def stop(self) -> None:
        """Give the mouse back to the views."""
        if self._tag is not None:
            self._stop_watching()
            self._interaction.SetPlaceModePersistence(0)
            self._interaction.SwitchToViewTransformMode()

    def _on_mode_changed(self, caller: Any, event: str) -> None:
        if self._interaction.GetCurrentInteractionMode() != slicer.vtkMRMLInteractionNode.Place:
            self._stop_watching()
            self._on_ended()

    def _stop_watching(self) -> None:
        if self._tag is not None:
            self._interaction.RemoveObserver(self._tag)
            self._tag = None
