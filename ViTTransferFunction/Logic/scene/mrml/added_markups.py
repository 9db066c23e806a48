"""Markups that are made while the user places points: Slicer goes on in each list that is made, whoever makes it."""

from __future__ import annotations

from typing import Any

import slicer


def add_markups(scene: slicer.vtkMRMLScene, class_name: str, name: str = "") -> Any:
    """Add a node of a class of markups, and leave what the user is placing, and where to, as it is."""
    selection = scene.GetSingletonNode("Singleton", "vtkMRMLSelectionNode")
    placed_class, placed_id = selection.GetActivePlaceNodeClassName(), selection.GetActivePlaceNodeID()
    was_modifying = selection.StartModify()
    node = scene.AddNewNodeByClass(class_name, name)
    selection.SetReferenceActivePlaceNodeClassName(placed_class)
    selection.SetActivePlaceNodeID(placed_id)
    selection.EndModify(was_modifying)
    return node
