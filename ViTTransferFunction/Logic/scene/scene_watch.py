"""What happens in the scene to what a session is about: its parameters, the nodes that these refer to, and the scene itself."""

from __future__ import annotations

from collections.abc import Callable

import slicer
import vtk

from .classes.added_scene import AddedScene
from .interface.parameters import SceneParameters
from .mrml.observers import SceneObservers

SEGMENT_EVENTS = ("SegmentAdded", "SegmentRemoved", "SegmentModified", "SourceRepresentationModified")
"""After which other segments may have other voxels."""


class SceneWatch:
    """Watches the scene, and the volume and the segmentation that are chosen in it, and calls back.

    Args:
        scene: the scene.
        parameters: refer to the volume and to the segmentation.
        on_parameters: parameters have changed, or the volume or where it lies; called from `look` on.
        on_nodes: nodes have gone, or many were changed at once; `on_parameters` is called next.
        on_segments: the chosen segmentation may have other segments, or lie elsewhere; dozens of times in a row, often.
        on_other_scene: the scene is another one.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        parameters: SceneParameters,
        on_parameters: Callable[[], None],
        on_nodes: Callable[[], None],
        on_segments: Callable[[], None],
        on_other_scene: Callable[[], None],
    ) -> None:
        self._scene = scene
        self._parameters = parameters
        self._on_parameters = on_parameters
        self._on_nodes = on_nodes
        self._on_segments = on_segments
        self._added_scene = AddedScene(scene, parameters.node, on_other_scene)
        self._observers = SceneObservers()
        other_scene = scene.EndRestoreEvent, scene.EndCloseEvent
        reactions = [
            (scene.NodeRemovedEvent, self._on_node_removed),
            *((event, lambda caller, event: on_other_scene()) for event in other_scene),
            (scene.EndBatchProcessEvent, self._on_batch_end),
        ]
        self._observers.observe(scene, reactions)
        self._observers.observe(parameters.node, [("ModifiedEvent", self._on_modified)])

    def look(self) -> None:
        """Watch the nodes that are chosen now, and no others; then `on_parameters` is called.

        Not while the scene is half loaded or half closed; then this comes by itself when it is complete.
        """
        if self._scene.IsBatchProcessing():
            return
        self._watch_chosen()
        self._on_parameters()

    @property
    def observer_count(self) -> int:
        """How many observers of the scene and its nodes there are."""
        return self._observers.count + self._added_scene.observer_count

    def close(self) -> None:
        """Stop watching."""
        self._observers.remove_all()
        self._added_scene.close()

    def _on_modified(self, caller: vtk.vtkObject, event: str) -> None:
        self.look()

    def _on_node_removed(self, caller: vtk.vtkObject, event: str) -> None:
        if not self._scene.IsBatchProcessing():
            self._on_nodes()
            self.look()

    def _on_batch_end(self, caller: vtk.vtkObject, event: str) -> None:
        """Many nodes were changed at once; where a scene replaces another one, not before the new one is complete."""
        self._on_nodes()
        self.look()

    def _watch_chosen(self) -> None:
        volume, segmentation = self._parameters.volume, self._parameters.segmentation
        if volume is not None:
            changes = (volume.ImageDataModifiedEvent, volume.TransformModifiedEvent, "ModifiedEvent")
            self._observers.observe(volume, [(event, self._on_modified) for event in changes])
        if segmentation is not None:
            segments = (getattr(slicer.vtkSegmentation, name) for name in SEGMENT_EVENTS)
            changes = (*segments, segmentation.DisplayModifiedEvent, segmentation.TransformModifiedEvent)
            self._observers.observe(segmentation, [(event, lambda caller, event: self._on_segments()) for event in changes])
        chosen = [node for node in (volume, segmentation) if node is not None]
        self._observers.keep_only([self._scene, self._parameters.node, *chosen])
