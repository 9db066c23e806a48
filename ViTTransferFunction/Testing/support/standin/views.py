"""Slice views as far as tools see them: a slice node, and an interactor whose events tests send."""

from __future__ import annotations

from typing import Any

import slicer
import vtk
from PySide6.QtCore import QObject, Signal
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

SIZE_PIXELS = 200
FIELD_OF_VIEW_MM = 200.0


class LayoutManager(QObject):
    """Three slice views.

    Args:
        scene: gets their slice nodes.
    """

    layoutChanged = Signal(int)  # noqa: N815

    def __init__(self, scene: Any) -> None:
        super().__init__()
        orientations = {"Red": "Axial", "Green": "Coronal", "Yellow": "Sagittal"}
        self._widgets = {name: SliceWidget(scene, name, orientation) for name, orientation in orientations.items()}

    def sliceViewNames(self) -> tuple[str, ...]:  # noqa: N802
        """Names of the slice views that the layout shows."""
        return tuple(self._widgets)

    def sliceWidget(self, name: str) -> SliceWidget:  # noqa: N802
        """A slice view by its name."""
        return self._widgets[name]


class SliceWidget:
    """A slice view, and the view in it."""

    def __init__(self, scene: Any, name: str, orientation: str) -> None:
        node = slicer.vtkMRMLSliceNode()
        node.SetLayoutName(name)
        node.SetSingletonTag(name)
        node.SetName(name)
        self._node = scene.AddNode(node)
        self._node.SetDefaultOrientation(orientation)
        self._node.SetDimensions(SIZE_PIXELS, SIZE_PIXELS, 1)
        self._node.SetFieldOfView(FIELD_OF_VIEW_MM, FIELD_OF_VIEW_MM, 1.0)
        self._interactor = vtkGenericRenderWindowInteractor()
        # Never drawn, but tools put their actors into it.
        window = vtk.vtkRenderWindow()
        window.SetOffScreenRendering(True)
        window.SetSize(SIZE_PIXELS, SIZE_PIXELS)
        window.AddRenderer(vtk.vtkRenderer())
        self._interactor.SetRenderWindow(window)

    def mrmlSliceNode(self) -> Any:  # noqa: N802
        """Where the view lies in the patient."""
        return self._node

    def sliceView(self) -> SliceWidget:  # noqa: N802
        """The view."""
        return self

    def interactor(self) -> Any:
        """Sends what the mouse does."""
        return self._interactor

    def scheduleRender(self) -> None:  # noqa: N802
        """Would draw the view soon."""
