"""A saved scene that is added to one in which somebody is working, instead of being opened in its place.

A scene has one parameter node of the module: that of the added scene takes the place of what the present one says, and what was
worked on would be out of reach. The classes that are added stay with the volume that they are of.
"""

from __future__ import annotations

from collections.abc import Callable

import slicer
import vtk

from ..interface.parameters import REFERENCES, referred
from ..mrml.observers import SceneObservers
from .class_nodes import CLASS_ROLE, adopt_class, class_nodes_of_all, give_to_volume

_FIRST = 1000.0
"""Before others hear that a scene was added: Slicer's subject hierarchy removes a node then, and the classes are read anew."""


class AddedScene:
    """Puts the parameters back where there are classes, and counts the classes that were added among these.

    Args:
        scene: the scene.
        parameter_node: of the module.
        on_opened: called where there were no classes: then the added scene counts as one that was opened.
    """

    def __init__(
        self, scene: slicer.vtkMRMLScene, parameter_node: slicer.vtkMRMLScriptedModuleNode, on_opened: Callable[[], None]
    ) -> None:
        self._node = parameter_node
        self._on_opened = on_opened
        self._before = _Work(parameter_node)
        self._observers = SceneObservers()
        reactions = [(scene.StartImportEvent, self._on_start), (scene.EndImportEvent, self._on_end)]
        self._observers.observe(scene, reactions, _FIRST)

    @property
    def observer_count(self) -> int:
        """How many observers of the scene there are."""
        return self._observers.count

    def close(self) -> None:
        """Stop watching."""
        self._observers.remove_all()

    def _on_start(self, caller: vtk.vtkObject, event: str) -> None:
        self._before = _Work(self._node)

    def _on_end(self, caller: vtk.vtkObject, event: str) -> None:
        if self._before.has_classes:
            self._before.put_back()
        else:
            self._on_opened()


def keep_work(scene: slicer.vtkMRMLScene, parameter_node: slicer.vtkMRMLScriptedModuleNode) -> None:
    """Do once what `AddedScene` does, for a scene that begins to be added while there is no session."""
    before, observers = _Work(parameter_node), SceneObservers()

    def on_end(caller: vtk.vtkObject, event: str) -> None:
        observers.remove_all()
        before.put_back()

    if before.has_classes:
        observers.observe(scene, [(scene.EndImportEvent, on_end)], _FIRST)


class _Work:
    """What a parameter node says now, to be put back."""

    def __init__(self, node: slicer.vtkMRMLScriptedModuleNode) -> None:
        self._node = node
        self._texts = {name: node.GetParameter(name) for name in node.GetParameterNames()}
        self._references = {role: self._referenced(role) for role in (CLASS_ROLE, *REFERENCES)}
        self.has_classes = bool(class_nodes_of_all(node))

    def put_back(self) -> None:
        """Have the node say so again, and refer to the classes that it has got since then, too."""
        present, volume = self._references[CLASS_ROLE], referred(self._node, "volume")
        added = [positive for positive in class_nodes_of_all(self._node) if positive.GetID() not in present]
        if volume is not None:
            give_to_volume(volume, added)
        was_modifying = self._node.StartModify()
        for name in {*self._node.GetParameterNames()} - self._texts.keys():
            self._node.UnsetParameter(name)
        for name, text in self._texts.items():
            self._node.SetParameter(name, text)
        for role, ids in self._references.items():
            self._node.RemoveNodeReferenceIDs(role)
            for id_ in ids:
                self._node.AddNodeReferenceID(role, id_)
        for positive in added:
            adopt_class(self._node, positive)
        self._node.EndModify(was_modifying)

    def _referenced(self, role: str) -> list[str]:
        return [self._node.GetNthNodeReferenceID(role, n) for n in range(self._node.GetNumberOfNodeReferences(role))]
