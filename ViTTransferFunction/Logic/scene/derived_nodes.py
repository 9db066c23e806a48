"""Nodes that show what can be computed again: in the scene, but not saved with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from uuid import uuid4

from .nodes import displays_of

if TYPE_CHECKING:
    import slicer


class DerivedNodes:
    """The nodes of one thing shown. Others may delete any of them at any time, also by closing the scene.

    Args:
        scene: where they are.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._scene = scene
        self._nodes: dict[str, Any] = {}

    def find(self, name: str) -> Any:
        """The node that was added under this name; None if it is not in the scene, or not any more."""
        node = self._nodes.get(name)
        return node if node is not None and self._scene.IsNodePresent(node) else None

    def add(self, class_name: str, name: str) -> Any:
        """A new node in the scene, which users see under this name.

        No node ever gets its identifier again: a scene view may still refer to it when it is gone.
        """
        id_ = f"{class_name}ViTTransferFunction{uuid4().hex}"
        return self.keep(self._scene.AddNewNodeByClassWithID(class_name, name, id_), name)

    def keep(self, node: Any, name: str) -> Any:
        """Count a node that is in the scene among these; returns it."""
        node.SetSaveWithScene(False)
        self._nodes[name] = node
        return node

    def release(self) -> list[Any]:
        """Leave those that are there to the scene, which saves them from now on; they are nobody's derived nodes any more."""
        nodes = [node for name in self._nodes if (node := self.find(name)) is not None]
        for node in nodes:
            node.SetSaveWithScene(True)
        self._nodes.clear()
        return nodes

    def remove(self) -> None:
        """Take them out of the scene, and what displays them."""
        # The latest first: what uses another node, colours say, was made after it.
        nodes = [node for name in reversed(self._nodes) if (node := self.find(name)) is not None]
        # Before any goes: who is told by the scene that it does may ask for this again.
        self._nodes.clear()
        displays = [display for node in nodes if node.IsA("vtkMRMLDisplayableNode") for display in displays_of(node)]
        for node in (*displays, *nodes):
            if self._scene.IsNodePresent(node):
                self._scene.RemoveNode(node)
