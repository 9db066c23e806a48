"""A volume of the scene being annotated and segmented: the one object that a front end talks to.

What the user decides lies in the scene: parameters in a parameter node, classes in point lists. This object watches them, has
maps computed in the compute process, and shows the results: overlay, contours, rendering, segments. It may be taken away at any
time and made again from the scene. Nothing here waits: a front end calls `poll` about every 20 ms while `busy`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import slicer
import vtk

from ..compute.client import ComputeClient
from ..compute.proxy import Phase, SegmentationProxy
from ..compute.requests import TakeVolume
from ..core.class_request import ClassRequest
from ..core.errors import InputError
from ..core.geometry import Geometry
from ..core.progress import WorkProgress
from ..session.feature_estimate import FeatureEstimate
from ..session.settings import SessionSettings
from .annotations import SceneAnnotations
from .classes import ClassState, Point, Polarity
from .contours import ShownMap
from .display import SceneDisplay
from .observers import SceneObservers
from .parameters import SceneParameters
from .point_tour import PointTour
from .regions import SceneRegions
from .segments import OutputSegment, write_segments
from .surface_points import moved_inside, placed_in_3d_view
from .volume import array_from_node, geometry_from_node, matrix_to_world, world_to_local


class SceneSession:
    """Connects the scene, the compute process, and what the views show.

    Args:
        scene: the scene.
        app_logic: the application's logic, which has the logics of its modules.
        parameter_node: holds the parameters and refers to the classes; it may come from a saved scene.
        python_executable: the Python that has PyTorch; the running one unless given.

    Attributes:
        parameters: the module's settings; writing one takes effect at once.
        annotations: classes and points, and their undo and redo.
        regions: adds the points of regions that the user encloses.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        parameter_node: slicer.vtkMRMLScriptedModuleNode,
        python_executable: str | Path | None = None,
    ) -> None:
        self._scene = scene
        self._app_logic = app_logic
        self._listeners: list[Callable[[], None]] = []
        self._error: str | None = None
        self._geometry: Geometry | None = None
        self._opened: tuple[Any, ...] | None = None
        self._asked: tuple[Any, ...] | None = None
        self.parameters = SceneParameters(parameter_node)
        self._proxy = SegmentationProxy(lambda: ComputeClient(python_executable))
        self._display = SceneDisplay(scene, app_logic)
        self._tour = PointTour(scene)
        self._observers = SceneObservers()
        self.annotations = SceneAnnotations(scene, parameter_node, self._on_annotations, self._settled)
        self.regions = SceneRegions(scene, self.annotations, self._in_volume)
        other_scene = (
            slicer.vtkMRMLScene.EndImportEvent,
            slicer.vtkMRMLScene.EndRestoreEvent,
            slicer.vtkMRMLScene.EndCloseEvent,
        )
        reactions = [
            (slicer.vtkMRMLScene.NodeRemovedEvent, self._on_node_removed),
            # What is shown is not saved, and must not stand in the way of what was shown before.
            (slicer.vtkMRMLScene.StartSaveEvent, lambda caller, event: self._display.hide()),
            (slicer.vtkMRMLScene.EndSaveEvent, lambda caller, event: self._show()),
        ]
        self._observers.observe(scene, reactions + [(event, self._on_other_scene) for event in other_scene])
        self._observers.observe(parameter_node, [("ModifiedEvent", self._on_parameters)])
        self._on_parameters()

    def add_observer(self, callback: Callable[[], None]) -> None:
        """Call `callback` after anything that a front end shows has changed."""
        self._listeners.append(callback)

    @property
    def phase(self) -> Phase:
        """How far the volume is."""
        return self._proxy.phase

    @property
    def progress(self) -> WorkProgress | None:
        """Of the running extraction or segmentation."""
        return self._proxy.progress

    @property
    def estimate(self) -> FeatureEstimate | None:
        """What the features will cost; None until known."""
        return self._proxy.estimate

    @property
    def busy(self) -> bool:
        """Whether `poll` has something to do."""
        return self._proxy.busy or self._display.pending

    @property
    def up_to_date(self) -> bool:
        """Whether what is shown follows from the annotations as they are now."""
        return self._proxy.up_to_date

    @property
    def compute_pid(self) -> int | None:
        """The number of the compute process; None where none runs."""
        return self._proxy.pid

    @property
    def observer_count(self) -> int:
        """How many observers of the scene and its nodes there are."""
        return self._observers.count + self.annotations.observer_count

    def take_error(self) -> str | None:
        """What went wrong since the last call, in words for the user."""
        error, self._error = self._error or self._proxy.take_error(), None
        return error

    def set_volume(self, node: slicer.vtkMRMLScalarVolumeNode | None) -> None:
        """Choose the volume to segment. Where its features are cached, they load at once."""
        self.parameters.set_reference("volume", node)

    def set_segmentation(self, node: slicer.vtkMRMLSegmentationNode | None) -> None:
        """Choose the segmentation that gets the segments."""
        self.parameters.set_reference("segmentation", node)

    @property
    def classes(self) -> tuple[ClassState, ...]:
        """All classes as they are now, in order."""
        return self.annotations.classes

    @property
    def selected_class(self) -> ClassState | None:
        """The class that is annotated, and whose similarity is overlaid; the first one until one is selected."""
        selected = self.parameters.get("selectedClass")
        return next((state for state in self.classes if state.id == selected), self.classes[0] if self.classes else None)

    def select_class(self, id_: str) -> None:
        """Choose the class that is annotated."""
        self.parameters.set("selectedClass", id_)

    def show_next_point(self, id_: str, polarities: Sequence[Polarity] = ("positive", "negative")) -> Point | None:
        """Centre the slice views on a class's next point of these polarities; see `PointTour`."""
        state = next(state for state in self.classes if state.id == id_)
        return self._tour.show_next([point for polarity in polarities for point in getattr(state, polarity)])

    def chosen_iso(self, id_: str) -> float | None:
        """The threshold that a class has now, chosen or set; None where it has no map yet."""
        class_map = self._proxy.maps.get(id_)
        return class_map.iso if class_map else None

    def volume_ml(self, id_: str) -> float | None:
        """How large a class's segment is by the maps as they are now, millilitres; None where it has no map yet."""
        return self._proxy.volumes_ml.get(id_)

    def start_extraction(self) -> None:
        """Begin to compute the volume's features."""
        self._proxy.extract()
        self._notify()

    def cancel(self) -> None:
        """Stop the extraction or segmentation that runs; what was there before stays."""
        self._proxy.cancel()

    def write_segments(self) -> None:
        """Have all classes segmented and written as segments; into a new segmentation where none is chosen."""
        if self.phase != "ready" or not self._requests():
            self._report("There is nothing to segment yet: compute the features, and place a point on each structure.")
            return
        self._proxy.segment(self.parameters.refinement())
        self._notify()

    def poll(self) -> None:
        """Take in what the compute process has to say, and send it what has become due."""
        events = self._proxy.poll()
        if events & {"maps", "refined", "rendering", "state"}:
            self._show()
        elif self._display.pending:
            self._display.advance()
        if "labels" in events:
            self._write_labels()
        if events:
            self._notify()

    def wait(self, timeout_s: float = 600.0) -> None:
        """Poll until nothing is under way: for scripts and tests. Raises TimeoutError."""
        until = time.monotonic() + timeout_s
        self.poll()
        while self.busy:
            if time.monotonic() > until:
                raise TimeoutError(f"still busy ({self.phase}) after {timeout_s:g} s")
            time.sleep(0.002)
            self.poll()

    def close(self) -> None:
        """End the compute process and take away what is shown; classes, parameters and segments stay in the scene."""
        self._listeners.clear()
        self._observers.remove_all()
        self.annotations.close()
        self._proxy.close()
        self._display.remove()

    def _on_annotations(self) -> None:
        self._ask_for_maps()
        self._show()
        self._notify()

    def _in_volume(self, points_ras: np.ndarray) -> np.ndarray:
        """(N,) bool: which of some points (N, 3) lie in the volume; all of them where there is none."""
        volume = self.parameters.volume
        if volume is None or self._geometry is None:
            return np.ones(len(points_ras), dtype=bool)
        return self._geometry.contains(world_to_local(volume, points_ras))

    def _settled(self, point_ras: np.ndarray) -> np.ndarray:
        """Where a point lies that was placed at `point_ras`: inside the structure, if that was on a surface in a 3D view."""
        volume = self.parameters.volume
        if volume is None or self._geometry is None or not placed_in_3d_view(self._scene, self._app_logic):
            return point_ras
        visible = {state.id for state in self.classes if state.visible}
        return moved_inside(point_ras, [m for id_, m in self._proxy.maps.items() if id_ in visible], matrix_to_world(volume))

    def _on_parameters(self, caller: vtk.vtkObject | None = None, event: str = "") -> None:
        if self._scene.IsBatchProcessing():
            return  # The scene is half loaded or half closed.
        self._watch_volume()
        self._open_volume()
        self.annotations.refresh()
        self._on_annotations()

    def _on_node_removed(self, caller: vtk.vtkObject, event: str) -> None:
        if not self._scene.IsBatchProcessing():
            self.annotations.refresh_and_record()
            self._on_parameters()

    def _on_other_scene(self, caller: vtk.vtkObject, event: str) -> None:
        self.annotations.restart()
        self._on_parameters()

    def _on_voxels(self, caller: vtk.vtkObject, event: str) -> None:
        self._opened = None
        self._on_parameters()

    def _watch_volume(self) -> None:
        volume, kept = self.parameters.volume, [self._scene, self.parameters.node]
        if volume is not None:
            reactions = (
                (slicer.vtkMRMLVolumeNode.ImageDataModifiedEvent, self._on_voxels),
                (slicer.vtkMRMLTransformableNode.TransformModifiedEvent, self._on_parameters),
                ("ModifiedEvent", self._on_parameters),
            )
            self._observers.observe(volume, reactions)
            kept.append(volume)
        self._observers.keep_only(kept)

    def _open_volume(self) -> None:
        """Hand the volume to the compute process, if it or what decides its features has changed."""
        node = self.parameters.volume
        geometry, settings = None, SessionSettings()
        try:
            settings = self.parameters.session_settings()
            geometry = geometry_from_node(node) if node else None
        except InputError as error:
            self._error = str(error)
        place = (node.GetID(), geometry.shape, geometry.ijk_to_ras.tobytes()) if geometry else None
        if (place, settings) != self._opened:
            self._opened = (place, settings)
            self._geometry = geometry
            self._asked = None
            volume = TakeVolume(array_from_node(node), geometry, node.GetName()) if geometry else None
            self._proxy.open(volume, settings)

    def _ask_for_maps(self) -> None:
        """Ask for maps, unless what they depend on is as it was when they were asked for last."""
        asked = (self._requests(), self.parameters.refinement())
        if asked != self._asked:
            self._asked = asked
            self._proxy.update(*asked)

    def _requests(self) -> list[ClassRequest]:
        """What the compute process has to know of each class that has a positive point in the volume."""
        node = self.parameters.volume
        if node is None or self._geometry is None:
            return []
        requests = (self._request(state, node, self._geometry) for state in self.classes)
        return [request for request in requests if request is not None]

    def _request(self, state: ClassState, node: slicer.vtkMRMLScalarVolumeNode, geometry: Geometry) -> ClassRequest | None:
        """In the volume's local frame, without the points beyond it; None where no positive one is left."""
        positive, negative = (
            world_to_local(node, np.array(points).reshape(-1, 3)) for points in (state.positive, state.negative)
        )
        inside = positive[geometry.contains(positive)]
        if not len(inside):
            return None
        return ClassRequest(
            state.id,
            inside,
            negative[geometry.contains(negative)],
            iso=state.iso,
            proximity=state.proximity,
            refine=state.refine,
            name=state.name.strip(),
        )

    def _show(self) -> None:
        """Bring the views up to date with maps, classes and parameters."""
        volume, selected = self.parameters.volume, self.selected_class
        visible = {state.id: state for state in self.classes if state.visible}
        styles = {id_: (state.color, state.opacity) for id_, state in visible.items()}
        self._proxy.look(self.parameters.rendering_mode(), styles)
        maps = self._proxy.maps
        if volume is None or not maps:
            self._display.hide()
            return
        overlaid = selected.id if selected and selected.id in visible and self.parameters.get("overlayVisible") else None
        self._display.show_maps(
            volume,
            [ShownMap(id_, class_map, visible[id_].color) for id_, class_map in maps.items() if id_ in visible],
            overlaid,
            self.parameters.get("overlayOpacity"),
        )
        self._display.show_rendering(volume, self._proxy.rendering)

    def _write_labels(self) -> None:
        """Turn the labels that arrived into segments of the classes that are still there."""
        assert self._proxy.labels is not None
        (labels, ids), self._proxy.labels = self._proxy.labels, None
        volume = self.parameters.volume
        states = {state.id: state for state in self.classes}
        segments = [
            OutputSegment(id_, states[id_].name, states[id_].color, labels.array == label)
            for label, id_ in enumerate(ids, start=1)
            if id_ in states
        ]
        if volume is None or not segments:
            return
        try:
            node = self.parameters.segmentation or self._new_segmentation(volume)
            write_segments(node, volume, segments, self.parameters.get("respectOtherSegments"), self._app_logic)
        except InputError as error:
            self._report(str(error))

    def _new_segmentation(self, volume: slicer.vtkMRMLScalarVolumeNode) -> slicer.vtkMRMLSegmentationNode:
        node = self._scene.AddNewNodeByClass("vtkMRMLSegmentationNode", f"{volume.GetName()} segmentation")
        self.set_segmentation(node)
        return node

    def _report(self, message: str) -> None:
        self._error = message
        self._notify()

    def _notify(self) -> None:
        for listener in list(self._listeners):
            listener()
