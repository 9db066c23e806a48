"""Surface smoothing of the 3D views: rays start at random depths, so that their steps leave no rings on translucent surfaces.

It is a setting of the views, which is saved with the scene. Where this file switches it on, an attribute of the view says so.
"""

from __future__ import annotations

from typing import Any

import slicer
import vtk

from ..mrml.nodes import nodes_of_class
from ..mrml.observers import SceneObservers

VIEW_CLASS = "vtkMRMLViewNode"
SWITCHED_ON = "ViTTransferFunction.surfaceSmoothingSwitchedOn"
"""Attribute of the views that had it off."""


class SurfaceSmoothing:
    """Switches surface smoothing on in all 3D views, also in those that appear while it is, and off again where it was off.

    A user who switches it off meanwhile does not get it back until it was switched off for all.

    Args:
        scene: where the views are. It may have been saved with the smoothing switched on: that is undone at once.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._scene = scene
        self._observers = SceneObservers()
        self.restore()

    def switch_on(self) -> None:
        """Switch it on, until `restore`."""
        reactions = [
            (slicer.vtkMRMLScene.NodeAddedEvent, self._on_node_added),
            (slicer.vtkMRMLScene.EndBatchProcessEvent, self._on_batch_end),
        ]
        self._observers.observe(self._scene, reactions)
        for view in nodes_of_class(self._scene, VIEW_CLASS):
            _switch_on(view)

    def restore(self) -> None:
        """Give each view back what it had."""
        self._observers.remove_all()
        for view in nodes_of_class(self._scene, VIEW_CLASS):
            if view.GetAttribute(SWITCHED_ON):
                _set(view, smoothing=False, mark=None)

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def _on_node_added(self, caller: vtk.vtkObject, event: str, node: Any) -> None:
        if node.IsA(VIEW_CLASS) and not self._scene.IsBatchProcessing():
            _switch_on(node)

    def _on_batch_end(self, caller: vtk.vtkObject, event: str) -> None:
        self.switch_on()


def _switch_on(view: Any) -> None:
    if not view.GetAttribute(SWITCHED_ON) and not view.GetVolumeRenderingSurfaceSmoothing():
        _set(view, smoothing=True, mark="1")


def _set(view: Any, smoothing: bool, mark: str | None) -> None:
    was_modifying = view.StartModify()
    view.SetVolumeRenderingSurfaceSmoothing(smoothing)
    view.SetAttribute(SWITCHED_ON, mark)
    view.EndModify(was_modifying)
