"""What the Data module lists, and where: point lists in a folder, segments beside their volume; nothing that is only shown.

Only Slicer's application keeps the tree, its subject hierarchy, up to date; elsewhere it lists next to nothing.
"""

from __future__ import annotations

from typing import Any

import slicer
import vtk

FOLDER_NAME = "ViT Transfer Function"
_ATTRIBUTE = "ViTTransferFunction"


def put_into_folder(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> None:
    """Move a node into the folder, which is made where there is none; users may rename the folder and move things out of it.

    Where the tree does not list the node, nothing is done.
    """
    hierarchy, item = _hierarchy(scene), _item(scene, node)
    if item is not None:
        hierarchy.SetItemParent(item, _folder(hierarchy))


def put_beside(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode, other: slicer.vtkMRMLNode) -> None:
    """Move a node to where another one is: into the study of its patient, say, in which alone Slicer exports to DICOM.

    Where the tree does not list them both, nothing is done.
    """
    hierarchy, item, item_of_other = _hierarchy(scene), _item(scene, node), _item(scene, other)
    if item is not None and item_of_other is not None:
        hierarchy.SetItemParent(item, hierarchy.GetItemParent(item_of_other))


def take_out(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> bool:
    """List a node of the scene no longer; returns whether it was listed.

    The scene is saved with all that is listed. What a node that is not saved leaves there is an entry that does nothing, one
    more each time.
    """
    item = _item(scene, node)
    return item is not None and bool(_hierarchy(scene).RemoveItem(item, False, False))


def put_back(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> None:
    """List a node that was taken out."""
    _hierarchy(scene).RequestOwnerPluginSearch(node)


def _hierarchy(scene: slicer.vtkMRMLScene) -> Any:
    return slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)


def _item(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> int | None:
    """What stands for a node in the tree."""
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
