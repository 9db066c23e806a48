"""What the tool bar of Slicer's module Markups does: the list in which points are placed is chosen in its box."""

from __future__ import annotations

from typing import Any

import slicer
import vtk

_LAST = -10.0
"""After all who do not say when they want to hear of it."""


def keep_markups_tool_bar(scene: Any) -> None:
    """Where the list is removed in which points are placed, have the box choose another, in which placing goes on."""
    selection = scene.GetSingletonNode("Singleton", "vtkMRMLSelectionNode")

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def on_going(caller: Any, event: str, node: Any) -> None:
        if node.GetID() == selection.GetActivePlaceNodeID() and not scene.IsClosing():
            nodes = (scene.GetNthNode(index) for index in range(scene.GetNumberOfNodes()))
            others = [other for other in nodes if other is not node and _is_offered(other)]
            if others:
                selection.SetActivePlaceNodeID(others[-1].GetID())

    scene.AddObserver(slicer.vtkMRMLScene.NodeAboutToBeRemovedEvent, on_going, _LAST)


def _is_offered(node: Any) -> bool:
    return node.IsA("vtkMRMLMarkupsNode") and not node.GetHideFromEditors()
