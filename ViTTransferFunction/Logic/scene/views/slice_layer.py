"""A volume over what the slice views show: an additional layer, which leaves background, foreground and label to the user.

Slicer blends additional layers over background and foreground and under the label. Other extensions may have some, too.
"""

from __future__ import annotations

from typing import Any

import slicer
import vtk

from ..mrml.nodes import nodes_of_class
from ..mrml.observers import SceneObservers

COMPOSITE_CLASS = "vtkMRMLSliceCompositeNode"
"""The nodes that say which volumes a slice view shows."""

_FIRST = slicer.vtkMRMLSliceCompositeNode.Layer_Last
"""Index of the first additional layer."""

_OPAQUE = 1.0
"""Opacity of an additional layer that nobody has set."""


class SliceLayer:
    """Shows a volume in all slice views, also in those that appear while it is shown.

    A view whose layer somebody took away meanwhile does not get it back until the volume was hidden.

    Args:
        scene: where slice views and volumes are.
        app_logic: of the application, which knows the logics of the slice views.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic) -> None:
        self._scene = scene
        self._app_logic = app_logic
        self._observers = SceneObservers()
        self._volume: slicer.vtkMRMLVolumeNode | None = None
        self._opacity = 0.0
        self._given: set[Any] = set()

    def show(self, volume: slicer.vtkMRMLVolumeNode, opacity: float) -> None:
        """Show a volume of the scene, at an opacity in [0, 1]; or show it at another opacity."""
        if volume is not self._volume:
            self.hide()
        elif opacity != self._opacity:
            for composite in nodes_of_class(self._scene, COMPOSITE_CLASS):
                if (index := _index_of(composite, volume)) is not None:
                    composite.SetNthLayerOpacity(index, opacity)
        self._volume, self._opacity = volume, opacity
        self._observe_scene()
        self._give_all()

    def hide(self) -> None:
        """Take the volume out of all slice views."""
        self._observers.remove_all()
        self._given.clear()
        # Also where it was hidden already: a scene view that was restored may have brought it back.
        for composite in nodes_of_class(self._scene, COMPOSITE_CLASS) if self._volume else []:
            self._take(composite, self._volume)

    def remove(self) -> None:
        """Hide the volume, and know it no more: it is about to go."""
        self.hide()
        self._volume = None

    def _observe_scene(self) -> None:
        events = slicer.vtkMRMLScene
        reactions = [
            (events.NodeAddedEvent, self._on_node_added),
            (events.EndImportEvent, self._on_restored),
            (events.EndRestoreEvent, self._on_restored),
            (events.EndBatchProcessEvent, self._on_batch_end),
        ]
        self._observers.observe(self._scene, reactions)

    def _give_all(self) -> None:
        for composite in nodes_of_class(self._scene, COMPOSITE_CLASS):
            self._observers.observe(composite, [("ModifiedEvent", self._on_composite_modified)])
            self._give(composite)

    def _give(self, composite: Any) -> None:
        """Add the layer where it can be seen, and take it away where it would be in the way."""
        volume = self._volume
        if volume is None or not self._scene.IsNodePresent(volume):
            self._forget_beyond(composite)
        elif not _blends(composite):
            self._take(composite, volume)
            self._given.discard(composite)
        elif composite not in self._given:
            self._given.add(composite)
            if _index_of(composite, volume) is None:
                _append(composite, volume, self._opacity)

    def _take(self, composite: Any, volume: Any) -> None:
        index = _index_of(composite, volume)
        if index is not None:
            _remove(composite, index)
        self._forget_beyond(composite)

    def _forget_beyond(self, composite: Any) -> None:
        """Have the view forget the layers beyond its last one.

        By itself it keeps their volumes, and once nothing else is shown it logs errors and goes on to show its last picture.
        """
        logic = self._app_logic.GetSliceLogicByLayoutName(composite.GetLayoutName())
        layer = logic.GetNthLayer(_end(composite)) if logic else None
        if layer is not None and layer.GetVolumeNode() is not None:
            layer.SetVolumeNode(None)

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def _on_node_added(self, caller: vtk.vtkObject, event: str, node: Any) -> None:
        if node.IsA(COMPOSITE_CLASS) and not self._scene.IsBatchProcessing():
            self._give_all()

    def _on_composite_modified(self, caller: vtk.vtkObject, event: str) -> None:
        if not self._scene.IsBatchProcessing():
            self._give(caller)

    def _on_restored(self, caller: vtk.vtkObject, event: str) -> None:
        # What the views show was replaced as a whole; nobody took a layer away.
        self._given.clear()

    def _on_batch_end(self, caller: vtk.vtkObject, event: str) -> None:
        self._give_all()


def _blends(composite: Any) -> bool:
    """Whether a view blends layers over a picture.

    Its other modes add colours where they are transparent, or put the layers in reverse order; without a picture below, a
    layer is opaque.
    """
    has_picture = composite.GetBackgroundVolumeID() or composite.GetForegroundVolumeID()
    return bool(has_picture) and composite.GetCompositing() == composite.Alpha


def _end(composite: Any) -> int:
    """Index of the layer after the last one."""
    return int(_FIRST + composite.GetNumberOfAdditionalLayers())


def _index_of(composite: Any, volume: Any) -> int | None:
    layers = range(_FIRST, _end(composite))
    return next((index for index in layers if composite.GetNthLayerVolumeID(index) == volume.GetID()), None)


def _append(composite: Any, volume: Any, opacity: float) -> None:
    end = _end(composite)
    was_modifying = composite.StartModify()
    # Slicer makes those below transparent that had no opacity of their own.
    below = {index: composite.GetNthLayerOpacity(index) for index in range(_FIRST, end)}
    for index, value in {**below, end: opacity}.items():
        composite.SetNthLayerOpacity(index, value)
    composite.SetNthLayerVolumeID(end, volume.GetID())
    composite.EndModify(was_modifying)


def _remove(composite: Any, index: int) -> None:
    """Take a layer out; those above it move down, and their opacities with them."""
    above = [composite.GetNthLayerOpacity(layer) for layer in range(index + 1, _end(composite))]
    was_modifying = composite.StartModify()
    composite.SetNthLayerVolumeID(index, None)
    for layer, opacity in enumerate([*above, _OPAQUE], start=index):
        composite.SetNthLayerOpacity(layer, opacity)
    composite.EndModify(was_modifying)
