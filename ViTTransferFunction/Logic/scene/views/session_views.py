"""Shows a session in the views, according to its parameters, and describes the look of its structures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import slicer

from ...compute.proxy import SegmentationProxy
from ...core.system.errors import InputError
from ...core.volumes.camera import middle_of
from ...core.volumes.geometry import transform_points
from ...rendering.appearance import UNSEEN, Appearance, detailed
from ...rendering.composition import DEPTH, SURFACE
from ...rendering.histogram_picture import histogram_svg
from ...rendering.intensity_histogram import IntensityHistogram, intensity_histogram
from ...rendering.structure_volume import StructureVolume
from ...rendering.surroundings import Surroundings
from ..classes.class_requests import ClassRequests
from ..classes.class_state import ClassState
from ..interface.message_texts import nothing_in_3d_text
from ..interface.notices import Notices
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..mrml.drawn_together import drawn_together
from ..mrml.nodes import name_for_scene
from ..mrml.transforms import matrix_to_world
from .context import OFF, context_names, named_surroundings
from .contours import ShownMap
from .display import SceneDisplay
from .proposal_outlines import MOST_AMBIGUOUS_POINTS, Proposals
from .rendering_cut import shown_cut


class SessionViews:
    """Updates the views for a session, and knows how structures look in them.

    Args:
        scene: the scene.
        app_logic: the application's logic, which has the logics of its modules.
        parameters: say what is to be shown.
        proxy: has the maps and the rendering.
        problems: gets problems that prevent showing them.
        notices: informs front ends of changes.
        windows_3d: returns the vtkRenderWindows of the 3D views that are shown.

    Attributes:
        give_way: whether `show` shows nothing, so that something else in the views can be seen.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        parameters: SceneParameters,
        proxy: SegmentationProxy,
        problems: Problems,
        notices: Notices,
        windows_3d: Callable[[], Iterable[Any]],
    ) -> None:
        self.give_way = False
        self._scene = scene
        self._app_logic = app_logic
        self._parameters = parameters
        self._proxy = proxy
        self._problems = problems
        self._notices = notices
        self._display = SceneDisplay(scene, app_logic, windows_3d)
        self._histograms: WeakKeyDictionary[StructureVolume, dict[int, IntensityHistogram]] = WeakKeyDictionary()

    @property
    def pending(self) -> bool:
        """Whether `advance` still has something to show."""
        return self._display.pending

    @property
    def drawing_quickly(self) -> bool:
        """Whether 3D views are drawn with fewer rays at the moment, because their look is being changed."""
        return self._display.drawing_quickly

    @property
    def context_names(self) -> list[str]:
        """The possible values of the parameter `context`: the surroundings that 3D views can show."""
        return context_names(self._app_logic)

    def look(self, state: ClassState) -> Appearance:
        """The look of a visible class in 3D views."""
        return detailed(state.look) if self._parameters.rendering_mode() == "transfer function" else state.look

    def window(self, state: ClassState) -> tuple[float, float] | None:
        """The intensities between which a class gets brighter and more opaque in 3D; None if it is not in 3D yet."""
        rendering, rendered = self._proxy.rendering, self._proxy.rendered
        if rendering is None or state.id not in rendered:
            return None
        return rendering.window(rendered.index(state.id), state.look)

    def histogram(self, state: ClassState) -> IntensityHistogram | None:
        """Histogram of the intensities in a class and around it; None if it is not in 3D yet."""
        rendering, rendered = self._proxy.rendering, self._proxy.rendered
        if rendering is None or state.id not in rendered:
            return None
        known, index = self._histograms.setdefault(rendering, {}), rendered.index(state.id)
        if index not in known:
            known[index] = intensity_histogram(rendering, index)
        return known[index]

    def histogram_svg(self, state: ClassState) -> str | None:
        """The same as an SVG picture with the class's transfer function (`histogram_picture`); None if it is not in 3D yet."""
        histogram, window = self.histogram(state), self.window(state)
        if histogram is None or window is None:
            return None
        return histogram_svg(histogram, window, self.look(state))

    def middle_ras(self) -> np.ndarray:
        """Middle of the structures in 3D, (3,) RAS millimetres, to which cameras in files are relative.

        Raises:
            InputError: there are no structures in 3D.
        """
        rendering, volume = self._proxy.rendering, self._parameters.volume
        inside = None if rendering is None else rendering.voxels[..., DEPTH] > SURFACE
        if rendering is None or volume is None or inside is None or not inside.any():
            raise InputError(nothing_in_3d_text())
        middle: np.ndarray = transform_points(matrix_to_world(volume), middle_of(rendering.geometry, [inside])[None])[0]
        return middle

    def show(self, classes: Sequence[ClassState], selected: ClassState | None, requests: ClassRequests, stale: bool) -> bool:
        """Update the views for the present maps, classes and parameters.

        Args:
            classes: all classes.
            selected: the class whose similarity is overlaid.
            requests: the last requests of the classes.
            stale: whether the volume's voxels have changed since the maps were computed.

        Returns:
            Whether the overlay in slice views has changed.
        """
        with drawn_together(self._app_logic):
            return self._show(classes, selected, requests, stale)

    def advance(self) -> None:
        """Do some hundredths of a second of the work that is left."""
        with drawn_together(self._app_logic):
            self._try_to(self._display.advance)

    def look_in_new_views(self) -> None:
        """See `ClassRendering.look_in_new_views`; to be called after the layout has changed."""
        self._display.look_in_new_views()

    def export_rendering(self) -> None:
        """Turn the 3D rendering into ordinary nodes of the scene, and switch the rendering that follows clicks off."""
        self._problems.solve("views")
        volume = self._parameters.volume
        if volume is None or self._display.export_rendering(name_for_scene(f"{volume.GetName()} structures")) is None:
            self._problems.put("views", "There is no 3D rendering. Place a point on a structure, and switch the 3D views on.")
        else:
            self._parameters.set("rendering", "off")
        self._notices.tell()

    def remove(self) -> None:
        """Remove all nodes that are shown from the scene."""
        self._display.remove()

    def _show(self, classes: Sequence[ClassState], selected: ClassState | None, requests: ClassRequests, stale: bool) -> bool:
        volume = self._parameters.volume
        visible = {state.id: state for state in classes if state.visible}
        rendered = {selected.id: selected} if selected and self._parameters.get("renderingSolo") else visible
        self._ask_for_rendering(rendered)
        maps = self._proxy.maps
        if volume is None:
            # Nodes that are only hidden would keep their voxels in memory.
            self._display.remove()
            return False
        if not maps or stale or self.give_way:
            self._display.hide()
            return False
        overlaid = selected.id if selected and self._parameters.get("overlayVisible") else None
        overlay_changed = self._display.show_maps(
            volume,
            [ShownMap(id_, class_map, visible[id_].color) for id_, class_map in maps.items() if id_ in visible],
            overlaid,
            self._parameters.get("overlayOpacity"),
        )
        self._display.show_proposals(volume, self._other_proposals(selected, requests))
        cut = shown_cut(self._scene, self._parameters, volume)
        looks = [self.look(rendered[id_]) if id_ in rendered else UNSEEN for id_ in self._proxy.rendered]
        self._try_to(lambda: self._display.show_rendering(volume, self._proxy.rendering, looks, self._surroundings(), cut))
        return overlay_changed

    def _ask_for_rendering(self, rendered: dict[str, ClassState]) -> None:
        mode = self._parameters.rendering_mode()
        casting = {id_: state.look.opacity > 0.0 for id_, state in rendered.items() if state.visible}
        surroundings = self._parameters.get("context") != OFF and self._parameters.get("contextStrength") > 0.0
        self._proxy.look(mode, casting, surroundings)
        if mode is None:
            self._problems.solve("views")

    def _surroundings(self) -> Surroundings:
        """The look of the surroundings of structures in 3D views."""
        name, strength, cut_away = (self._parameters.get(name) for name in ("context", "contextStrength", "contextCutAway"))
        return named_surroundings(self._app_logic, name, strength, cut_away, self._proxy.rendering)

    def _other_proposals(self, selected: ClassState | None, requests: ClassRequests) -> Proposals | None:
        """The selected class's other proposals; None if they are switched off, or points or size are definite enough."""
        maps = self._proxy.low_maps
        if selected is None or not selected.visible or not self._parameters.get("proposalsVisible"):
            return None
        request = requests.of(selected.id)
        if selected.id not in maps or request is None or maps[selected.id].proposals is None:
            return None
        if not selected.size and len(request.positive) + len(request.negative) > MOST_AMBIGUOUS_POINTS:
            return None
        others = tuple(class_map for id_, class_map in maps.items() if id_ != selected.id)
        only_annotated = self._parameters.refinement().only_annotated_components
        return Proposals(selected.id, selected.color, maps[selected.id], others, request.positive, only_annotated)

    def _try_to(self, show: Callable[[], None]) -> None:
        try:
            show()
        except InputError as error:
            self._problems.put("views", str(error))
