"""A volume of the scene being annotated and segmented: the one object that a front end talks to.

What the user decides lies in the scene: parameters in a parameter node, classes in point lists. This object watches them, has
maps computed in the compute process, and shows the results: overlay, contours, rendering, segments. It may be taken away at any
time and made again from the scene. Nothing here waits: a front end calls `poll` about every 20 ms while `busy`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
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
from .classes import ClassState
from .contours import ShownMap
from .display import SceneDisplay
from .observers import SceneObservers
from .parameters import SceneParameters
from .problems import Problems
from .segments import OutputSegment, write_segments
from .volume import array_from_node, world_to_local
from .volume_content import Frame, VolumeContent, content_of, is_playing

REST_S = 0.5
"""How long a volume must have kept its voxels before they are taken up: somebody may be leafing through a sequence."""


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
        self._problems = Problems()
        self._content: VolumeContent | None = None
        self._opened: tuple[Any, ...] | None = None
        self._changed_s: float | None = None
        self._outside: dict[str, int] = {}
        self._asked: tuple[Any, ...] | None = None
        self.parameters = SceneParameters(parameter_node)
        self._proxy = SegmentationProxy(lambda: ComputeClient(python_executable))
        self._display = SceneDisplay(scene, app_logic)
        self._observers = SceneObservers()
        self.annotations = SceneAnnotations(scene, parameter_node, self._on_annotations)
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
        return self._proxy.busy or self._display.pending or self.volume_changed

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
        return self._problems.take()

    @property
    def errors(self) -> tuple[str, ...]:
        """What went wrong and still stands in the way, whether it was taken or not."""
        return self._problems.standing

    @property
    def volume_changed(self) -> bool:
        """Whether the volume has got other voxels, which are taken up when it rests and nothing runs for those before."""
        return self._changed_s is not None

    @property
    def frame(self) -> Frame | None:
        """The frame of a sequence that phase, estimate and features are of; None where the volume is no sequence."""
        return self._content.frame if self._content else None

    @property
    def points_outside(self) -> dict[str, int]:
        """How many points lie outside the volume and do not count, by the id of their class; only classes that have some."""
        return self._outside

    def set_volume(self, node: slicer.vtkMRMLScalarVolumeNode | None) -> None:
        """Choose the volume to segment. Where its features are cached, they load at once."""
        self.parameters.set_reference("volume", node)

    def set_segmentation(self, node: slicer.vtkMRMLSegmentationNode | None) -> None:
        """Choose the segmentation that gets the segments."""
        self._problems.solve("segments")
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

    def chosen_iso(self, id_: str) -> float | None:
        """The threshold that a class has now, chosen or set; None where it has no map yet."""
        class_map = self._proxy.maps.get(id_)
        return class_map.iso if class_map else None

    def estimate_again(self) -> None:
        """Take the volume up anew, where something that it needs was refused or lost: it may be there by now."""
        self._opened = None
        self._on_parameters()

    def start_extraction(self) -> None:
        """Begin to compute the volume's features."""
        self._problems.solve("segments")
        self._compute(self._proxy.extract)
        self._notify()

    def cancel(self) -> None:
        """Stop the extraction or segmentation that runs; what was there before stays."""
        self._proxy.cancel()

    def write_segments(self) -> None:
        """Have all classes segmented and written as segments; into a new segmentation where none is chosen."""
        self._problems.solve("segments")
        self._problems.solve("computing")
        if self.phase != "ready" or not self._requests():
            self._report("There is nothing to segment yet: compute the features, and place a point on each structure.")
            return
        if self.volume_changed:
            self._report("The image has just changed. Wait until its features are ready, then create the segments.")
            return
        self._proxy.segment(self.parameters.refinement())
        self._notify()

    def poll(self) -> None:
        """Take in what the compute process has to say, and send it what has become due."""
        events = self._proxy.poll()
        if "maps" in events:
            self._problems.solve("computing")
        if error := self._proxy.take_error():
            self._problems.put("computing", error)
        if events & {"maps", "refined", "rendering", "state"}:
            self._show()
        elif self._display.pending:
            self._display.advance()
        if "labels" in events:
            self._write_labels()
        self._take_up_changes()
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
        """The user went on, or took back what they did."""
        self._problems.solve("segments")
        self._follow()

    def _follow(self) -> None:
        self._ask_for_maps()
        self._show()
        self._notify()

    def _on_parameters(self, caller: vtk.vtkObject | None = None, event: str = "") -> None:
        if self._scene.IsBatchProcessing():
            return  # The scene is half loaded or half closed.
        self._watch_volume()
        self._open_volume()
        self.annotations.refresh()
        self._follow()

    def _on_node_removed(self, caller: vtk.vtkObject, event: str) -> None:
        if not self._scene.IsBatchProcessing():
            self.annotations.refresh_and_record()
            self._on_parameters()

    def _on_other_scene(self, caller: vtk.vtkObject, event: str) -> None:
        self.annotations.restart()
        self._on_parameters()

    def _watch_volume(self) -> None:
        volume, kept = self.parameters.volume, [self._scene, self.parameters.node]
        if volume is not None:
            reactions = (
                (slicer.vtkMRMLVolumeNode.ImageDataModifiedEvent, self._on_parameters),
                (slicer.vtkMRMLTransformableNode.TransformModifiedEvent, self._on_parameters),
                ("ModifiedEvent", self._on_parameters),
            )
            self._observers.observe(volume, reactions)
            kept.append(volume)
        self._observers.keep_only(kept)

    def _open_volume(self) -> None:
        """Hand the volume to the compute process, if it or what decides its features has changed."""
        node, content, settings = self.parameters.volume, None, SessionSettings()
        try:
            settings = self.parameters.session_settings()
            content = content_of(node) if node else None
            self._problems.solve("volume")
        except InputError as error:
            self._problems.put("volume", str(error))
        opened = (node.GetID() if content else None, settings)
        if opened != self._opened:
            self._opened = opened
            self._hand_over(content, settings)
        elif content is not None and self._content is not None:
            self._changed_s = None if content.state == self._content.state else time.monotonic()

    def _take_up_changes(self) -> None:
        """Hand other voxels over once they rest. What the user waits for is finished first: it is kept for its frame."""
        node = self.parameters.volume
        if self._changed_s is None or self.progress is not None or node is None:
            return
        if is_playing(node):
            self._changed_s = time.monotonic()
        elif time.monotonic() >= self._changed_s + REST_S:
            self._opened = None
            self._on_parameters()

    def _hand_over(self, content: VolumeContent | None, settings: SessionSettings) -> None:
        self._content, self._changed_s, self._asked = content, None, None
        node = self.parameters.volume
        volume = TakeVolume(array_from_node(node), content.geometry, node.GetName()) if content else None
        self._compute(lambda: self._proxy.open(volume, settings))

    def _compute(self, ask: Callable[[], None]) -> None:
        """Ask the compute process, which may not start."""
        self._problems.solve("computing")
        try:
            ask()
        except InputError as error:
            self._problems.put("computing", str(error))

    def _ask_for_maps(self) -> None:
        """Ask for maps, unless what they depend on is as it was when they were asked for last."""
        asked = (self._requests(), self.parameters.refinement())
        if asked != self._asked:
            self._asked = asked
            self._proxy.update(*asked)

    def _requests(self) -> list[ClassRequest]:
        """What the compute process has to know of each class that has a positive point in the volume."""
        node = self.parameters.volume
        self._outside = {}
        geometry = self._geometry
        if node is None or geometry is None:
            return []
        requests = [self._request(state, node, geometry) for state in self.classes]
        return [request for request in requests if request is not None]

    @property
    def _geometry(self) -> Geometry | None:
        """Of the voxels that the compute process has."""
        return self._content.geometry if self._content else None

    def _request(self, state: ClassState, node: slicer.vtkMRMLScalarVolumeNode, geometry: Geometry) -> ClassRequest | None:
        """In the volume's local frame, without the points beyond it; None where no positive one is left."""
        positive, negative = (
            world_to_local(node, np.array(points).reshape(-1, 3)) for points in (state.positive, state.negative)
        )
        inside, beside = positive[geometry.contains(positive)], negative[geometry.contains(negative)]
        if outside := len(positive) + len(negative) - len(inside) - len(beside):
            self._outside[state.id] = outside
        if not len(inside):
            return None
        return ClassRequest(
            state.id,
            inside,
            beside,
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
        if volume is None or not maps or self.volume_changed:
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
        if self.volume_changed:
            self._report("The image has changed meanwhile, so no segments were written. Create them again when it is ready.")
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
        self._problems.put("segments", message)
        self._notify()

    def _notify(self) -> None:
        for listener in list(self._listeners):
            listener()
