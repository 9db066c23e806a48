"""What Slicer's module Segmentations offers to other modules: the button that shows surfaces, and the Segment Editor."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import slicer
from PySide6.QtCore import QObject, QSignalBlocker, Signal
from PySide6.QtWidgets import QPushButton, QWidget

SURFACE = "Closed surface"


class qMRMLSegmentationShow3DButton(QPushButton):  # noqa: N801
    """Is down while a segmentation has surfaces; makes and removes them."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setCheckable(True)
        self.setEnabled(False)
        self._node: Any = None
        self._tags: list[int] = []
        self.toggled.connect(self._on_toggled)
        self.destroyed.connect(lambda: self._observe(None))

    def setSegmentationNode(self, node: Any) -> None:  # noqa: N802
        """Choose the segmentation."""
        if node is not None and not node.IsA("vtkMRMLSegmentationNode"):
            raise TypeError(f"expected a vtkMRMLSegmentationNode, got {node}")
        self._observe(node)
        self._update()

    def _observe(self, node: Any) -> None:
        for tag in self._tags:
            self._node.RemoveObserver(tag)
        self._node = node
        names = ("SegmentAdded", "SegmentRemoved", "ContainedRepresentationNamesModified")
        events = ["ModifiedEvent", *(getattr(slicer.vtkSegmentation, name) for name in names)] if node is not None else []
        self._tags = [node.AddObserver(event, lambda caller, event: self._update()) for event in events]

    def _update(self) -> None:
        segmentation = self._node.GetSegmentation() if self._node is not None else None
        if segmentation is None:
            self.setEnabled(False)
            return
        self.setEnabled(segmentation.GetNumberOfSegments() > 0 and segmentation.GetSourceRepresentationName() != SURFACE)
        with QSignalBlocker(self):
            self.setChecked(segmentation.ContainsRepresentation(SURFACE))

    def _on_toggled(self, on: bool) -> None:
        if self._node is None:
            return
        segmentation = self._node.GetSegmentation()
        if not on:
            segmentation.RemoveRepresentation(SURFACE)
        elif segmentation.CreateRepresentation(SURFACE) and self._node.GetDisplayNode() is not None:
            self._node.GetDisplayNode().SetPreferredDisplayRepresentationName3D(SURFACE)


class SegmentEditor:
    """The module Segment Editor: its widget, and the parameters that it keeps in the scene.

    Args:
        scene: gets the parameters.
    """

    def __init__(self, scene: Any) -> None:
        node = scene.CreateNodeByClass("vtkMRMLSegmentEditorNode")
        node.UnRegister(None)
        node.SetSingletonTag("SegmentEditor")
        self.parameterSetNode = scene.AddNode(node)
        self.editor = self
        self.entered = False

    def widgetRepresentation(self) -> Any:  # noqa: N802
        """The widget of the module."""
        return SimpleNamespace(self=lambda: self)

    def enter(self) -> None:
        """The user opens the module."""
        self.entered = True

    def setSegmentationNode(self, node: Any) -> None:  # noqa: N802
        """Choose the segmentation."""
        self.parameterSetNode.SetAndObserveSegmentationNode(node)

    def setSourceVolumeNode(self, node: Any) -> None:  # noqa: N802
        """Choose the source volume; without effect as long as there is no segmentation."""
        if self.parameterSetNode.GetSegmentationNode() is not None:
            self.parameterSetNode.SetAndObserveSourceVolumeNode(node)

    def setCurrentSegmentID(self, segment_id: str) -> None:  # noqa: N802
        """Choose the segment to edit."""
        self.parameterSetNode.SetSelectedSegmentID(segment_id)


class ModuleSelector(QObject):
    """Has the user go from module to module, and tells of it: what is connected first, the panel of modules, goes first.

    Args:
        modules: what is entered and left, by name.
        selected: which one is open.
    """

    moduleSelected = Signal(str)  # noqa: N815

    def __init__(self, modules: dict[str, Any], selected: str) -> None:
        super().__init__()
        self._modules = modules
        self.selectedModule = selected

    def selectModule(self, name: str) -> None:  # noqa: N802
        """Open a module, and leave the one that is open."""
        if name != self.selectedModule:
            leave = getattr(self._modules[self.selectedModule], "exit", None)
            if leave is not None:
                leave()
            self.selectedModule = name
            self._modules[name].enter()
            self.moduleSelected.emit(name)
