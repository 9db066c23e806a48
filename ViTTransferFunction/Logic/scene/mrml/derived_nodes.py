"""Nodes that display results which can be computed again: in the scene, but neither saved with it nor listed.

Slicer counts listed nodes as unsaved: it would warn of them whenever a scene is closed, and then offer nothing to save.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from .data_tree import put_back, take_out
from .nodes import displays_of

if TYPE_CHECKING:
    import slicer


class DerivedNodes:
    """The nodes by which one thing is displayed. Users may delete any of them at any time, also by closing the scene.

    Args:
        scene: the scene that they are in.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._scene = scene
        self._kept: dict[str, _Kept] = {}

    def find(self, name: str) -> Any:
        """The node that was added under this name; None if there is none in the scene."""
        kept = self._kept.get(name)
        return kept.node if kept is not None and self._scene.IsNodePresent(kept.node) else None

    def add(self, class_name: str, name: str) -> Any:
        """Add a new node to the scene, with a name for users.

        Its ID is never used again, because a scene view may still refer to it after it was removed.
        """
        id_ = f"{class_name}ViTTransferFunction{uuid4().hex}"
        return self.keep(self._scene.AddNewNodeByClassWithID(class_name, name, id_), name)

    def keep(self, node: Any, name: str) -> Any:
        """Make a node of the scene one of these derived nodes; returns it."""
        was_hidden = node.GetHideFromEditors()
        node.SetSaveWithScene(False)
        _hide(node)
        # It may be listed already, because a node with a name of its own is added before anything can be set.
        self._kept[name] = _Kept(node, bool(was_hidden), take_out(self._scene, node))
        return node

    def release(self) -> list[Any]:
        """Make the existing nodes ordinary nodes of the scene, which are saved and listed; returns them."""
        there = [self._kept[name] for name in self._kept if self.find(name) is not None]
        for kept in there:
            kept.node.SetSaveWithScene(True)
            kept.node.SetHideFromEditors(kept.was_hidden)
            if kept.was_listed:
                put_back(self._scene, kept.node)
        self._kept.clear()
        return [kept.node for kept in there]

    def remove(self) -> None:
        """Remove the nodes and their display nodes from the scene."""
        # The latest first: a node that uses another one, such as a table of colours, was made after it.
        nodes = [node for name in reversed(self._kept) if (node := self.find(name)) is not None]
        # Before any is removed: an observer of the removal may call this method again.
        self._kept.clear()
        displays = [display for node in nodes if node.IsA("vtkMRMLDisplayableNode") for display in displays_of(node)]
        for node in (*displays, *nodes):
            if self._scene.IsNodePresent(node):
                self._scene.RemoveNode(node)


@dataclass(frozen=True, eq=False)
class _Kept:
    """A node, whether it was hidden from editors before, and whether the Data module listed it."""

    node: Any
    was_hidden: bool
    was_listed: bool


def _hide(node: Any) -> None:
    """Remove a node from all lists of nodes.

    Slicer's lists, such as that of scans above a slice view, check whether a node is hidden when it is added, and again only
    when its name changes. When the chosen node is removed, they choose the next one, and the views would show that.
    """
    node.SetHideFromEditors(True)
    name = node.GetName()
    node.SetName(f"{name} ")
    node.SetName(name)
