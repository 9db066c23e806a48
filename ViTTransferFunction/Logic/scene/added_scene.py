"""A saved scene that is added to one in which somebody is working, instead of being opened in its place.

A scene has one parameter node of the module: that of the added scene takes the place of what the present one says, and what was
worked on would be out of reach.
"""

from __future__ import annotations

from collections.abc import Callable

import slicer
import vtk

from .classes import CLASS_ROLE, adopt_class, class_nodes
from .observers import SceneObservers
from .parameters import REFERENCES

_FIRST = 1000.0
"""Before others hear that a scene was added: Slicer's subject hierarchy removes a node then, and the classes are read anew."""


class AddedScene:
    """Puts the parameters back where there are classes, and puts the classes that were added below these.

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
        self._texts: dict[str, str] = {}
        self._references: dict[str, list[str]] = {}
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
        self._texts = {name: self._node.GetParameter(name) for name in self._node.GetParameterNames()}
        present = class_nodes(self._node)
        self._references = {role: self._referenced(role) for role in (CLASS_ROLE, *REFERENCES)} if present else {}

    def _on_end(self, caller: vtk.vtkObject, event: str) -> None:
        if not self._references:
            self._on_opened()
            return
        added = [positive for positive in class_nodes(self._node) if positive.GetID() not in self._references[CLASS_ROLE]]
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
