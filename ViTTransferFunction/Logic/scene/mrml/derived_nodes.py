"""Nodes that show what can be computed again: in the scene, but neither saved with it nor listed.

What is listed counts as unsaved: Slicer would warn of it whenever a scene is closed, and offer nothing to be saved.
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
    """The nodes of one thing shown. Others may delete any of them at any time, also by closing the scene.

    Args:
        scene: where they are.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._scene = scene
        self._kept: dict[str, _Kept] = {}

    def find(self, name: str) -> Any:
        """The node that was added under this name; None if it is not in the scene, or not any more."""
        kept = self._kept.get(name)
        return kept.node if kept is not None and self._scene.IsNodePresent(kept.node) else None

    def add(self, class_name: str, name: str) -> Any:
        """A new node in the scene, which users see under this name.

        No node ever gets its identifier again: a scene view may still refer to it when it is gone.
        """
        id_ = f"{class_name}ViTTransferFunction{uuid4().hex}"
        return self.keep(self._scene.AddNewNodeByClassWithID(class_name, name, id_), name)

    def keep(self, node: Any, name: str) -> Any:
        """Count a node that is in the scene among these; returns it."""
        was_hidden = node.GetHideFromEditors()
        node.SetSaveWithScene(False)
        _hide(node)
        # It is listed already: a node that gets a name of its own is added before anything can be set.
        self._kept[name] = _Kept(node, bool(was_hidden), take_out(self._scene, node))
        return node

    def release(self) -> list[Any]:
        """Leave those that are there to the scene, which saves and lists them from now on; they are nobody's derived nodes."""
        there = [self._kept[name] for name in self._kept if self.find(name) is not None]
        for kept in there:
            kept.node.SetSaveWithScene(True)
            kept.node.SetHideFromEditors(kept.was_hidden)
            if kept.was_listed:
                put_back(self._scene, kept.node)
        self._kept.clear()
        return [kept.node for kept in there]

    def remove(self) -> None:
        """Take them out of the scene, and what displays them."""
        # The latest first: what uses another node, colours say, was made after it.
        nodes = [node for name in reversed(self._kept) if (node := self.find(name)) is not None]
        # Before any goes: who is told by the scene that it does may ask for this again.
        self._kept.clear()
        displays = [display for node in nodes if node.IsA("vtkMRMLDisplayableNode") for display in displays_of(node)]
        for node in (*displays, *nodes):
            if self._scene.IsNodePresent(node):
                self._scene.RemoveNode(node)


@dataclass(frozen=True, eq=False)
class _Kept:
    """A node, whether editors were not shown it by themselves, and whether the Data module listed it."""

    node: Any
    was_hidden: bool
    was_listed: bool


def _hide(node: Any) -> None:
    """Have it in no list of nodes.

    Slicer's, such as those of scans above a slice view, look at a node when it is added, and again only when it gets another
    name. Where the chosen one is removed, they choose what is beside it: views would show this by themselves.
    """
    node.SetHideFromEditors(True)
    name = node.GetName()
    node.SetName(f"{name} ")
    node.SetName(name)
