"""What Slicer's Data module does with nodes that come and go: each that one of its plugins knows gets an item in the tree."""

from __future__ import annotations

from typing import Any

import slicer
import vtk

KNOWN = (
    "vtkMRMLScalarVolumeNode",
    "vtkMRMLModelNode",
    "vtkMRMLMarkupsNode",
    "vtkMRMLSegmentationNode",
    "vtkMRMLTransformNode",
    "vtkMRMLTableNode",
)
"""Classes that the plugins know, with all that inherit from them, as far as a session has such nodes."""


def keep_subject_hierarchy(scene: Any) -> None:
    """Keep the scene's tree of nodes up to date from now on."""
    events = slicer.vtkMRMLScene

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def on_added(caller: Any, event: str, node: Any) -> None:
        if not scene.IsImporting():
            _list(scene, node)

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def on_going(caller: Any, event: str, node: Any) -> None:
        if not scene.IsClosing() and not node.IsA("vtkMRMLSubjectHierarchyNode"):
            hierarchy = _hierarchy(scene)
            item = hierarchy.GetItemByDataNode(node)
            if item != hierarchy.GetInvalidItemID():
                hierarchy.RemoveItem(item, False, False)

    def on_imported(caller: Any, event: str) -> None:
        for index in range(scene.GetNumberOfNodes()):
            _list(scene, scene.GetNthNode(index))

    scene.AddObserver(events.NodeAddedEvent, on_added)
    scene.AddObserver(events.NodeAboutToBeRemovedEvent, on_going)
    scene.AddObserver(events.EndImportEvent, on_imported, 10.0)


def items_without_node(scene: Any) -> list[str]:
    """Names of the items that stand for no node and hold nothing: users see them, and they do nothing."""
    hierarchy, items = _hierarchy(scene), vtk.vtkIdList()
    hierarchy.GetItemChildren(hierarchy.GetSceneItemID(), items, True)
    ids = [items.GetId(index) for index in range(items.GetNumberOfIds())]
    return [
        hierarchy.GetItemName(id_)
        for id_ in ids
        if hierarchy.GetItemDataNode(id_) is None and not hierarchy.GetNumberOfItemChildren(id_)
    ]


def _list(scene: Any, node: Any) -> None:
    """Only where it is not hidden by then: afterwards, nobody looks."""
    if not node.GetHideFromEditors() and any(map(node.IsA, KNOWN)):
        _hierarchy(scene).RequestOwnerPluginSearch(node)


def _hierarchy(scene: Any) -> Any:
    return slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)
