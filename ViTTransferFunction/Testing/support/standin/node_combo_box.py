"""`qMRMLNodeComboBox`: nodes of a scene to choose from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import slicer
import vtk
from PySide6.QtCore import Property, QSignalBlocker, Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QSizePolicy, QWidget

_LAST = -10.0
"""After all who do not say when they want to hear of it."""


@dataclass(frozen=True)
class _LookedAt:
    """What was seen of a node that is watched under a tag."""

    tag: int
    name: str
    hidden: bool


class qMRMLNodeComboBox(QWidget):  # noqa: N801
    """Lists the nodes of `nodeTypes` that are in the scene and not hidden.

    By itself, it wants to be as wide as the longest name.
    """

    currentNodeChanged = Signal(object)  # noqa: N815

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scene: Any = None
        self._tags: list[int] = []
        self._nodes: list[Any] = []
        self._looked_at: dict[Any, _LookedAt] = {}
        self._types: list[str] = []
        self._none, self._none_display = False, "None"
        self._combo_box = QComboBox(self)
        self._combo_box.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._combo_box)
        # The list passes the keyboard on to this frame, which has no use for keys.
        self._combo_box.setFocusProxy(self)
        self._combo_box.currentIndexChanged.connect(lambda: self.currentNodeChanged.emit(self.currentNode()))
        self.destroyed.connect(lambda: self.setMRMLScene(None))

    def setMRMLScene(self, scene: Any) -> None:  # noqa: N802
        """Watch a scene, and list its nodes."""
        for tag in self._tags:
            self._scene.RemoveObserver(tag)
        for node, looked_at in self._looked_at.items():
            node.RemoveObserver(looked_at.tag)
        self._looked_at.clear()
        self._scene = scene
        reactions = dict.fromkeys(("NodeAddedEvent", "NodeRemovedEvent", "EndCloseEvent"), self._fill)
        reactions["EndImportEvent"] = self._fill_anew
        self._tags = [self._observe(name, react) for name, react in reactions.items()] if scene else []
        if scene:
            self._tags.append(scene.AddObserver(slicer.vtkMRMLScene.NodeAboutToBeRemovedEvent, self._take_out, _LAST))
            self._fill()

    def mrmlScene(self) -> Any:  # noqa: N802
        """The scene."""
        return self._scene

    def currentNode(self) -> Any:  # noqa: N802
        """The node that is chosen, or None."""
        index = self._combo_box.currentIndex()
        return self._nodes[index] if 0 <= index < len(self._nodes) else None

    def setCurrentNode(self, node: Any) -> None:  # noqa: N802
        """Choose a node."""
        self._combo_box.setCurrentIndex(self._nodes.index(node) if node in self._nodes else -1)

    def _observe(self, event: str, react: Callable[[], None]) -> int:
        tag: int = self._scene.AddObserver(getattr(slicer.vtkMRMLScene, event), lambda *_: react())
        return tag

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def _take_out(self, scene: Any, event: str, node: Any) -> None:
        """A node is removed: where it was the one that is chosen, Qt chooses one beside it, and that is announced."""
        if node in self._nodes and not scene.IsClosing():
            index = self._nodes.index(node)
            del self._nodes[index]
            self._combo_box.removeItem(index)

    def _fill_anew(self) -> None:
        """Slicer's takes all nodes out of its list when a scene was added, and so forgets which one was chosen."""
        self.setCurrentNode(None)
        self._fill()

    def _fill(self) -> None:
        current = self.currentNode()
        nodes = [None] if self._none else []
        for index in range(self._scene.GetNumberOfNodes()):
            node = self._scene.GetNthNode(index)
            if node.GetClassName() in self._types and not self._is_hidden(node):
                nodes.append(node)
        for node in [node for node in self._looked_at if not self._scene.IsNodePresent(node)]:
            node.RemoveObserver(self._looked_at.pop(node).tag)
        with QSignalBlocker(self._combo_box):
            self._nodes = nodes
            self._combo_box.clear()
            self._combo_box.addItems([node.GetName() if node else self._none_display for node in nodes])
            self._combo_box.setCurrentIndex(nodes.index(current) if current in nodes else 0 if nodes else -1)
        if self.currentNode() is not current:
            self.currentNodeChanged.emit(self.currentNode())

    def _is_hidden(self, node: Any) -> bool:
        """Whether it was hidden when Slicer's looked at it: when it came, and when it got another name."""
        if node not in self._looked_at:
            tag = node.AddObserver(vtk.vtkCommand.ModifiedEvent, self._look_again)
            self._looked_at[node] = _LookedAt(tag, node.GetName(), bool(node.GetHideFromEditors()))
        return self._looked_at[node].hidden

    def _look_again(self, node: Any, event: str) -> None:
        looked_at = self._looked_at[node]
        if node.GetName() != looked_at.name:
            self._looked_at[node] = _LookedAt(looked_at.tag, node.GetName(), bool(node.GetHideFromEditors()))
            self._fill()

    def _set_types(self, types: list[str]) -> None:
        self._types = list(types)

    def _set_none(self, none: bool) -> None:
        self._none = none

    def _set_none_display(self, text: str) -> None:
        self._none_display = text

    nodeTypes = Property(list, lambda self: self._types, _set_types)  # noqa: N815
    noneEnabled = Property(bool, lambda self: self._none, _set_none)  # noqa: N815
    noneDisplay = Property(str, lambda self: self._none_display, _set_none_display)  # noqa: N815
    showChildNodeTypes = Property(bool, lambda self: False, lambda self, shown: None)  # noqa: N815
    addEnabled = Property(bool, lambda self: False, lambda self, enabled: None)  # noqa: N815
    removeEnabled = Property(bool, lambda self: False, lambda self, enabled: None)  # noqa: N815
    renameEnabled = Property(bool, lambda self: False, lambda self, enabled: None)  # noqa: N815
