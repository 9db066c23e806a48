"""The session of annotating and segmenting a volume of the scene: the single entry point for front ends.

All user input is stored in the scene: parameters in a parameter node, classes in point lists. The session observes these, has
maps computed in the compute process, and shows the results: overlay, contours, rendering, segments. It can be discarded at any
time and created again from the scene. Nothing here blocks: a front end calls `poll` about every 10 ms while `busy`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import slicer

from ..compute.client import ComputeClient
from ..compute.proxy import Event, Phase, SegmentationProxy
from ..core.system.progress import WorkProgress
from ..session.feature_estimate import FeatureEstimate
from .annotation.annotations import SceneAnnotations
from .annotation.asked_maps import AskedMaps
from .annotation.close_up_hints import CloseUpHints
from .annotation.close_ups import SceneCloseUps
from .annotation.continued_segments import ContinuedSegments
from .annotation.file_classes import FileClasses
from .annotation.left_behind import LeftBehind
from .annotation.other_scans import OtherScans
from .annotation.regions import SceneRegions
from .annotation.scan_of_points import ScanOfPoints
from .annotation.selected_class import SelectedClass
from .annotation.shown_structures import ShownStructures
from .classes.class_state import Classes, ClassState, Polarity
from .classes.of_volume import bring_back
from .classes.point_tour import PointTour
from .interface.cache_contents import CacheContents
from .interface.message_texts import nothing_hit_text, unexpected_text
from .interface.notices import Notices
from .interface.parameters import SceneParameters
from .interface.problems import Problems
from .mrml.drawn_together import drawn_together
from .scan_change import ScanChange
from .scene_watch import SceneWatch
from .segments.frame_segments import FrameSegments
from .segments.scene_segments import SceneSegments
from .segments.segment_points import SegmentPoints
from .tools.points_in_3d import PointsIn3D
from .views.awaited_answer import AwaitedAnswer, Waiting
from .views.session_views import SessionViews
from .volumes.former_model import FormerModel
from .volumes.opened_volume import OpenedVolume
from .volumes.volume_content import Frame


class SceneSession:
    """Connects the scene, the compute process, and the views. Front ends also use the parts among its attributes.

    Args:
        scene: the scene.
        app_logic: the application's logic, which gives access to the logics of its modules.
        parameter_node: contains the parameters and references to the classes; may come from a saved scene.
        python_executable: a Python with PyTorch; None: the running one.
        windows_3d: returns the vtkRenderWindows of the 3D views that are shown; these are drawn with fewer rays while the
            look of structures is being changed.
        points_3d: returns the displayable managers for points of all 3D views; see `PointsIn3D`.
        have_views_wait: called with the views that should not be drawn until an answer has arrived; see `AwaitedAnswer`.
        may_compute: whether that Python has PyTorch. Nothing is computed before; call `estimate_again` when this changes.

    Attributes:
        parameters: the module's settings; changes take effect immediately.
        annotations: edits classes and points, with undo and redo.
        selection: the class that is annotated; follows changes of the classes.
        file_classes: converts classes to annotation files and back.
        regions: adds points for shapes that the user draws.
        close_ups: segments classes in a close-up, or in the whole volume again.
        close_up_hints: reasons why a close-up may improve a class, or was begun automatically.
        other_scans: other scans in the scene with structures, which can be copied from there.
        views: the content and look of the views.
        shown: the structures that are shown, and which points lie on them.
        segments: writes classes as segments; knows which exist, and whether the classes have changed since.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        parameter_node: slicer.vtkMRMLScriptedModuleNode,
        python_executable: str | Path | None = None,
        windows_3d: Callable[[], Iterable[Any]] = tuple,
        points_3d: Callable[[], Iterable[Any]] = tuple,
        have_views_wait: Callable[[Waiting], None] = lambda which: None,
        may_compute: Callable[[], bool] = lambda: True,
    ) -> None:
        self._notices = Notices()
        self._problems = Problems()
        self.parameters = SceneParameters(parameter_node)
        self._proxy = SegmentationProxy(lambda: ComputeClient(python_executable), may_compute)
        self._awaited = AwaitedAnswer(self._proxy, have_views_wait)
        self._former_model = FormerModel(self.parameters, self._proxy, self._problems)
        self._volume = OpenedVolume(self.parameters, self._proxy, self._problems, self._former_model)
        self.views = SessionViews(scene, app_logic, self.parameters, self._proxy, self._problems, self._notices, windows_3d)
        self._tour = PointTour(scene)
        self._segment_points = SegmentPoints(scene)
        self._points_in_3d = PointsIn3D(app_logic, points_3d, self._tell_of_nothing_hit)
        self.annotations = SceneAnnotations(
            scene,
            parameter_node,
            self._on_annotations,
            lambda point_ras: self.shown.settled(point_ras),
            self._points_in_3d.hold,
            lambda: drawn_together(app_logic),
        )
        self.selection = SelectedClass(self.parameters, self.annotations)
        self.shown = ShownStructures(
            scene, app_logic, self.parameters, self.annotations, self.selection, self._volume, self._proxy
        )
        self._continued_segments = ContinuedSegments(
            scene,
            self.parameters,
            self.annotations,
            self.selection,
            self._segment_points,
            self._problems,
            self._notices,
        )
        self._scan_change = ScanChange(
            self.parameters, self.annotations, self._continued_segments, self._problems, self.selection, self._notices
        )
        self._maps = AskedMaps(
            self.parameters, self.annotations, self.selection, self._volume, self._segment_points, self._proxy
        )
        self.segments = SceneSegments(
            scene,
            app_logic,
            self.parameters,
            self._proxy,
            self._problems,
            self._notices,
            self._volume,
            lambda: self.classes,
            lambda: self._maps.requests.requests,
        )
        self._frames = FrameSegments(self.parameters, self._volume, lambda: self.classes, self.segments, self._problems)
        self._segments_changed = False
        self._scan_of_points = ScanOfPoints(self.parameters, self.annotations, self._volume, self._problems)
        self.file_classes = FileClasses(
            self.parameters,
            self.annotations,
            self.selection,
            self._volume,
            self._maps,
            self._scan_of_points,
            self._problems,
            self._notices,
            on_model=self._on_model,
        )
        self.other_scans = OtherScans(self.parameters, self.annotations, self.selection, self._volume.contains)
        self.close_ups = SceneCloseUps(
            self.parameters, self.annotations, self._volume, self._maps, self._proxy, self._problems, self._notices
        )
        self.close_up_hints = CloseUpHints(self.parameters, self.annotations, self._volume, self._maps, self._proxy)
        self.regions = SceneRegions(
            scene, self.annotations, self._volume.contains, lambda: self._volume.body_scale, self.close_up_hints.note_outline
        )
        self._left_behind = LeftBehind(self.parameters, self.annotations, self._problems)
        self._look_due = True
        self._watch = SceneWatch(
            scene,
            self.parameters,
            on_parameters=self._on_parameters,
            on_nodes=self.annotations.refresh_and_record,
            on_segments=self._on_segments,
            on_other_scene=self._on_other_scene,
        )
        self._watch.look()

    def add_observer(self, callback: Callable[[], None]) -> None:
        """Call `callback` after each change of what front ends show."""
        self._notices.add_observer(callback)

    @property
    def body_scale(self) -> float:
        """Factor for lengths that suit human bodies; less than 1 for smaller volumes."""
        return self._volume.body_scale

    @property
    def phase(self) -> Phase:
        """The state of the volume."""
        return self._proxy.phase

    @property
    def progress(self) -> WorkProgress | None:
        """Progress of an extraction, a segmentation, close-ups, or the writing of segments; None if none is running."""
        return self._proxy.progress or self.segments.progress

    @property
    def looks_closer(self) -> bool:
        """Whether `progress` is the progress of close-ups."""
        return self._proxy.looks_closer

    @property
    def estimate(self) -> FeatureEstimate | None:
        """Estimated cost of the features; None until known."""
        return self._proxy.estimate

    @property
    def busy(self) -> bool:
        """Whether `poll` has something to do."""
        return (
            self._proxy.busy
            or self.views.pending
            or self.segments.busy
            or self._segment_points.busy
            or self._continued_segments.busy
            or self._segments_changed
            or self.volume_changed
        )

    @property
    def awaits_maps(self) -> bool:
        """Whether requested maps have not arrived yet; `poll` should then be called more often."""
        return self._proxy.awaits_maps

    @property
    def up_to_date(self) -> bool:
        """Whether the maps that are shown belong to the current annotations."""
        return self._proxy.up_to_date

    @property
    def selected_up_to_date(self) -> bool:
        """The same for the selected class alone, whose map arrives slightly before the others."""
        return self._proxy.first_up_to_date

    @property
    def compute_pid(self) -> int | None:
        """The process id of the compute process; None if none runs."""
        return self._proxy.pid

    @property
    def observer_count(self) -> int:
        """Number of observers of the scene and its nodes."""
        return self._watch.observer_count + self.annotations.observer_count

    def take_error(self) -> str | None:
        """The next error that has not been returned yet, as a message to the user; None if there is none."""
        return self._problems.take()

    @property
    def errors(self) -> tuple[str, ...]:
        """Messages about current problems, whether `take_error` has returned them or not."""
        return self._problems.standing

    @property
    def volume_changed(self) -> bool:
        """Whether the volume's voxels have changed.

        The new voxels are used when changes have stopped and nothing is running for the old ones.
        """
        return self._volume.changed

    @property
    def frame(self) -> Frame | None:
        """The frame of a sequence to which phase, estimate and features belong; None if the volume is not a sequence."""
        return self._volume.content.frame if self._volume.content else None

    @property
    def points_beyond(self) -> dict[str, int]:
        """Number of points outside the volume, which do not count, by class id; only classes that have some."""
        return self._maps.requests.points_beyond

    @property
    def points_without_intensity(self) -> dict[str, int]:
        """Number of points where the volume has no intensity, by class id; only classes that have some."""
        return self._maps.requests.points_without_intensity

    def set_volume(self, node: slicer.vtkMRMLScalarVolumeNode | None) -> None:
        """Choose the volume to segment; cached features are loaded immediately. See `ScanChange`."""
        self._scan_change.go_to(node)

    def set_segmentation(self, node: slicer.vtkMRMLSegmentationNode | None) -> None:
        """Choose the segmentation that gets the segments."""
        self._problems.solve("segments", "older segments")
        self.parameters.set_reference("segmentation", node)
        if node is not None:
            bring_back(node)

    @property
    def classes(self) -> Classes:
        """All classes as they are now, in order."""
        return self.annotations.classes

    @property
    def selected_class(self) -> ClassState | None:
        """The class that is annotated, and whose similarity is overlaid; the first one by default."""
        return self.selection.state

    def select_class(self, id_: str) -> None:
        """Choose the class that is annotated."""
        self.selection.select(id_)

    def show_next_point(self, id_: str, polarities: Sequence[Polarity] = ("positive", "negative")) -> None:
        """Centre the slice views on a class's next point of these polarities; see `PointTour`."""
        state = next(state for state in self.classes if state.id == id_)
        self._tour.show_next([point for polarity in polarities for point in getattr(state, polarity)])

    def continue_segment(self, segment_id: str) -> None:
        """Create a class with points in a segment of the chosen segmentation, to improve it; `poll` finds the points."""
        self._continued_segments.choose(segment_id)

    def chosen_iso(self, id_: str) -> float | None:
        """The current iso value of a class, chosen automatically or set; None if the class has no map yet."""
        class_map = self._proxy.maps.get(id_)
        return class_map.iso if class_map else None

    def volume_ml(self, id_: str) -> float | None:
        """Volume of a class's segment in the scene by the current maps, in millilitres; None until known."""
        local_ml, enlargement = self._proxy.volumes_ml.get(id_), self._volume.enlargement
        return None if local_ml is None or enlargement is None else enlargement * local_ml

    def start_computing(self) -> None:
        """Start the compute process ahead of time, because this takes seconds."""
        self._proxy.start()

    def estimate_again(self) -> None:
        """Open the volume again, after something that it needs was refused or lost and may be available now."""
        self._on_opened(self._volume.open_again())

    def remove_model(self) -> None:
        """Delete the weights of the model that the settings name from the cache.

        Raises:
            InputError: they cannot be deleted, or there are none.
        """
        CacheContents(self.parameters).remove_model()
        if self.phase == "no features":
            # The estimate changes: the weights have to be downloaded, with the user's consent. Or they were damaged before.
            self.estimate_again()

    def give_way_to_segments(self, give_way: bool) -> None:
        """Hide structures while their segments, if written, are being corrected by hand; or show them again.

        They have the colour and position of the segment: parts that are removed from it would seem to remain.
        """
        give_way = give_way and self.segments.exist
        if give_way != self.views.give_way:
            self.views.give_way = give_way
            self._show()
            self._notices.tell()

    def start_extraction(self) -> None:
        """Start computing the volume's features."""
        self._problems.solve("segments", "computing")
        self._proxy.extract()
        self._take_problem()
        self._notices.tell()

    def cancel(self) -> None:
        """Cancel the running extraction, segmentation or close-up; earlier results are kept."""
        if self.looks_closer:
            self.close_ups.take_back()
        else:
            self._proxy.cancel()
        self.segments.cancel()
        self._notices.tell()

    def poll(self) -> None:
        """Receive replies of the compute process, send requests that have become due, and update what is shown."""
        was_busy = self.busy
        events = self._proxy.poll()
        self._take_in(events)
        self._awaited.tell()
        segments_changed = self._search_in_segments()
        writing = self.segments.busy
        if "labels" in events or writing:
            self.segments.advance()
        # Work that the user waits for is finished first; its result is kept for the frame before.
        if self.progress is None and self._volume.has_rested():
            self._on_opened(self._volume.open_again())
        points_told = self._look_at_points()
        came_to_rest = was_busy and not self.busy
        # Observers are notified of the first map together with all maps.
        if events - {"first map"} or writing or segments_changed or points_told or came_to_rest:
            self._notices.tell()

    def tell_of_defect(self, error: Exception) -> bool:
        """Report an unexpected error to the user, once until they continue, because each call of `poll` may raise it again.

        Returns:
            Whether it was reported now; the front end then also logs the error.
        """
        if self._problems.stands("defect"):
            return False
        self._problems.put("defect", unexpected_text(error))
        self._notices.tell()
        return True

    def wait(self, timeout_s: float = 600.0) -> None:
        """Poll until nothing is running, for scripts and tests.

        Raises:
            TimeoutError: it is still busy after this time.
        """
        until = time.monotonic() + timeout_s
        self.poll()
        while self.busy:
            if time.monotonic() > until:
                raise TimeoutError(f"still busy ({self.phase}) after {timeout_s:g} s")
            time.sleep(0.002)
            self.poll()

    def close(self) -> None:
        """End the compute process and remove what is shown; classes, parameters and segments stay in the scene."""
        self._notices.close()
        self._watch.close()
        self.annotations.close()
        self._points_in_3d.close()
        self._proxy.close()
        self.views.remove()

    def _take_in(self, events: set[Event]) -> None:
        """Handle the events of the compute process: show new results, or continue to show earlier ones."""
        if "maps" in events:
            self._problems.solve("computing")
            if self._proxy.up_to_date:
                self.close_ups.remember_shown()
        self._take_problem()
        if "state" in events:
            self._former_model.look(has_structures=bool(self.classes))
        if events & {"first map", "maps", "refined", "rendering", "state"}:
            self._show()
        elif self.views.pending and not self.awaits_maps:
            # While new maps are awaited, finishing the display of old ones would delay them.
            self.views.advance()
        if "refined" in events:
            for id_, close_up in self.close_up_hints.take_unasked().items():
                self.close_ups.look_at(id_, close_up)

    def _search_in_segments(self) -> bool:
        """Continue to search for points in segments; returns whether the chosen segmentation has changed."""
        found = self._segment_points.busy and self._segment_points.advance()
        changed, self._segments_changed = self._segments_changed, False
        if found or changed or self._continued_segments.busy:
            self._continued_segments.begin()
            self._maps.ask()
        return changed

    def _look_at_points(self) -> bool:
        """After a change, check the positions of points and boxes, and their scan; returns whether messages have changed."""
        due, self._look_due = self._look_due, False
        if not due:
            return False
        left_behind, other_scan = self._left_behind.look(), self._scan_of_points.look()
        self.close_ups.go_along()
        return left_behind or other_scan

    def _on_annotations(self) -> None:
        """Handle a change of the annotations by the user, or its undo."""
        self._problems.solve("segments", "older segments", "close-up", "placing", "defect")
        self.close_up_hints.note()
        self._follow()

    def _follow(self) -> None:
        self._look_due = True
        self._maps.ask()
        self._awaited.show_before(self._show)
        self._notices.tell()

    def _tell_of_nothing_hit(self) -> None:
        # Every such click gets a message, even if the message about the click before was closed.
        self._problems.solve("placing")
        self._problems.put("placing", nothing_hit_text())
        self._notices.tell()

    def _on_parameters(self) -> None:
        # During an edit, classes may be missing temporarily.
        if not self.annotations.editing:
            self._on_opened(self._volume.open())

    def _on_model(self, name: str) -> None:
        """Prepare for structures that were made with this model; "": not known."""
        self._former_model.remember(name)
        self._on_parameters()

    def _on_opened(self, anew: bool) -> None:
        """Handle a check of the volume; `anew`: it was sent to the compute process again."""
        returned = False
        if anew:
            self._maps.forget()
            self.segments.cancel()
            returned = self._frames.follow()
        self._take_problem()
        self.annotations.refresh()
        if anew:
            self.close_up_hints.forget()
        self._follow()
        if anew and self._frames.tell_of_older(returned):
            self._notices.tell()

    def _on_other_scene(self) -> None:
        self.annotations.restart()
        self.close_ups.forget()
        self._left_behind.forget()
        self._scan_of_points.forget()
        self.close_up_hints.forget()
        self._segment_points.forget()
        self._continued_segments.forget()

    def _on_segments(self) -> None:
        # Left to the next poll, since these calls come in bursts.
        self._segments_changed = self._look_due = True

    def _show(self) -> bool:
        """Show the current maps; returns whether this changed what slice views show."""
        return self.views.show(self.classes, self.selected_class, self._maps.requests, stale=self.volume_changed)

    def _take_problem(self) -> None:
        if error := self._proxy.take_error():
            self._problems.put("computing", error)
        if self._proxy.phase == "ready":
            if self._proxy.not_kept:
                self._problems.put("cache", self._proxy.not_kept)
            else:
                self._problems.solve("cache")
