"""The folder in the Data module that keeps the point lists of all classes together."""

from __future__ import annotations

from typing import Any

import slicer
import vtk

FOLDER_NAME = "ViT Transfer Function"
_ATTRIBUTE = "ViTTransferFunction"


def put_into_folder(scene: slicer.vtkMRMLScene, node: slicer.vtkMRMLNode) -> None:
    """Move a node into the folder, which is made where there is none; users may rename the folder and move things out of it.

    Only Slicer's application keeps its subject hierarchy up to date; where it does not list the node, nothing is done.
    """
    hierarchy = slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)
    item = hierarchy.GetItemByDataNode(node)
    if item != hierarchy.GetInvalidItemID():
        hierarchy.SetItemParent(item, _folder(hierarchy))


def _folder(hierarchy: Any) -> int:
    children = vtk.vtkIdList()
    hierarchy.GetItemChildren(hierarchy.GetSceneItemID(), children, True)
    for n in range(children.GetNumberOfIds()):
        if hierarchy.HasItemAttribute(children.GetId(n), _ATTRIBUTE):
            return children.GetId(n)
    folder = hierarchy.CreateFolderItem(hierarchy.GetSceneItemID(), FOLDER_NAME)
    hierarchy.SetItemAttribute(folder, _ATTRIBUTE, "classes")
    return folder
