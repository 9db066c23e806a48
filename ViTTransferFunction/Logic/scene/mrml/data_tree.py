"""Where the Data module lists nodes: point lists in a folder, segments beside their volume, derived nodes nowhere.

The tree is Slicer's subject hierarchy. Only Slicer's application keeps it up to date; elsewhere it lists next to nothing.
"""

from __future__ import annotations

from typing import Any

import slicer
import vtk

FOLDER_NAME = "ViT Transfer Function"
_ATTRIBUTE = "ViTTransferFunction"


def put_into_folder(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> None:
    """Move a node into the folder, which is created if it is missing; users may rename it and move nodes out of it.

    Does nothing if the tree does not list the node.
    """
    hierarchy, item = _hierarchy(scene), _item(scene, node)
    if item is not None:
        hierarchy.SetItemParent(item, _folder(hierarchy))


def put_beside(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode, other: slicer.vtkMRMLNode) -> None:
    """Move a node beside another one, for example into its patient's study, which Slicer needs for an export to DICOM.

    Does nothing if the tree does not list both.
    """
    hierarchy, item, item_of_other = _hierarchy(scene), _item(scene, node), _item(scene, other)
    if item is not None and item_of_other is not None:
        hierarchy.SetItemParent(item, hierarchy.GetItemParent(item_of_other))


def take_out(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> bool:
    """Remove a node from the tree; returns whether it was listed.

    The tree is saved with the scene. A listed node that is not saved leaves a dead entry, one more each time.
    """
    item = _item(scene, node)
    return item is not None and bool(_hierarchy(scene).RemoveItem(item, False, False))


def put_back(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> None:
    """List a node again that was taken out."""
    _hierarchy(scene).RequestOwnerPluginSearch(node)


def _hierarchy(scene: slicer.vtkMRMLScene) -> Any:
    return slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)


def _item(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> int | None:
    """The item of a node in the tree; None if it is not listed."""
    hierarchy = _hierarchy(scene)
    item = hierarchy.GetItemByDataNode(node)
    return int(item) if item != hierarchy.GetInvalidItemID() else None


def _folder(hierarchy: Any) -> int:
    children = vtk.vtkIdList()
    hierarchy.GetItemChildren(hierarchy.GetSceneItemID(), children, True)
    for n in range(children.GetNumberOfIds()):
        if hierarchy.HasItemAttribute(children.GetId(n), _ATTRIBUTE):
            return children.GetId(n)
    folder = hierarchy.CreateFolderItem(hierarchy.GetSceneItemID(), FOLDER_NAME)
    hierarchy.SetItemAttribute(folder, _ATTRIBUTE, "classes")
    return folder
