"""Shows a session in the views: overlay and contours in the slice views, a rendering in the 3D views."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import slicer

from ...core.volumes.stepped_work import SteppedWork
from ...rendering.appearance import Appearance
from ...rendering.structure_volume import StructureVolume
from ...rendering.surroundings import Surroundings
from ..volumes.volume_nodes import image_of
from .contours import Contours, ShownMap, Surface, iso_surface
from .overlay import SimilarityOverlay
from .proposal_outlines import ProposalOutlines, Proposals
from .rendering import ClassRendering


class SceneDisplay:
    """Shows maps and structures by derived nodes, which are made when they are first needed.

    Args:
        scene: the scene.
        app_logic: the application's logic, which has the logics of slice views and volume rendering.
        windows_3d: the vtkRenderWindows of the 3D views that are shown.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkMRMLApplicationLogic,
        windows_3d: Callable[[], Iterable[Any]] = tuple,
    ) -> None:
        self._overlay = SimilarityOverlay(scene, app_logic)
        self._contours = Contours(scene)
        self._proposals = ProposalOutlines(scene)
        self._rendering = ClassRendering(scene, app_logic, windows_3d)
        self._volume: slicer.vtkMRMLScalarVolumeNode | None = None
        self._transform = ""
        self._moved = False
        self._overlaid: tuple[ShownMap, float, str] | None = None
        self._shown: dict[str, ShownMap] = {}
        self._outlined: dict[str, tuple[ShownMap, Surface]] = {}
        self._outlining: tuple[ShownMap, SteppedWork[Surface]] | None = None
        self._rendered: StructureVolume | None = None
        self._look: tuple[tuple[Appearance, ...], Surroundings] = (), Surroundings()
        self._left_out: frozenset[int] = frozenset()

    def show_maps(
        self,
        volume: slicer.vtkMRMLScalarVolumeNode,
        shown: Sequence[ShownMap],
        overlaid: str | None,
        overlay_opacity: float,
    ) -> bool:
        """Show the contours of these classes, and the map of the one whose id is `overlaid` as a coloured overlay.

        The overlay is shown at once. `advance` shows the contours, first that of the same class, then all others together.

        Returns:
            Whether the overlay has changed.
        """
        self._follow(volume)
        first = sorted(shown, key=lambda of_class: of_class.class_id != overlaid)
        self._shown = {of_class.class_id: of_class for of_class in first}
        overlay_before = self._overlaid
        self._show_overlay(self._shown.get(overlaid or ""), overlay_opacity)
        if self._moved or self._outlined.keys() - self._shown.keys():
            self._moved = False
            self._outlined = {id_: outlined for id_, outlined in self._outlined.items() if id_ in self._shown}
            self._show_contours()
        return self._overlaid is not overlay_before

    def show_proposals(self, volume: slicer.vtkMRMLScalarVolumeNode, proposals: Proposals | None) -> None:
        """Show the outlines of a class's other proposals after everything else; None: show none."""
        self._proposals.show(volume, proposals)

    def show_rendering(
        self,
        volume: slicer.vtkMRMLScalarVolumeNode,
        rendering: StructureVolume | None,
        looks: Sequence[Appearance],
        surroundings: Surroundings,
        cut: Any,
    ) -> None:
        """Show structures in the 3D views; if they are shown already, only change their look.

        Args:
            volume: the volume that was segmented.
            rendering: the structures; None: show none.
            looks: their looks, in the order of their numbers.
            surroundings: the look of what belongs to no structure.
            cut: see `ClassRendering.cut`.
        """
        if rendering is None:
            self._rendered = None
            self._rendering.hide()
            return
        self._follow(volume)
        look = tuple(looks), surroundings
        rendered, looked, left_out = self._rendered, self._look, self._left_out
        hidden = _hidden(looks, surroundings)
        # Set before showing, so that a rendering that cannot be shown is not tried again and again.
        self._rendered, self._look = rendering, look
        if rendered is not rendering or left_out - hidden:
            self._left_out = hidden
            image, uniforms = image_of(rendering.voxels_without(hidden)), rendering.uniforms(*look)
            self._rendering.show(volume, image, len(rendering.own_levels), uniforms, rendering.geometry.ijk_to_ras)
        elif looked != look:
            self._rendering.change(rendering.uniforms(*look))
        self._rendering.cut(cut)

    def look_in_new_views(self) -> None:
        """See `ClassRendering.look_in_new_views`."""
        self._rendering.look_in_new_views()

    def export_rendering(self, name: str) -> slicer.vtkMRMLVectorVolumeNode | None:
        """See `ClassRendering.export`."""
        return self._rendering.export(name)

    @property
    def pending(self) -> bool:
        """Whether there is something still to be shown."""
        lacking = any(self._lacks_outline(of_class) for of_class in self._shown.values())
        return lacking or self._proposals.pending or self.drawing_quickly

    @property
    def drawing_quickly(self) -> bool:
        """Whether 3D views are drawn with fewer rays, since their look is being changed."""
        return self._rendering.drawing_quickly

    def advance(self) -> None:
        """Do some hundredths of a second of the work that is left."""
        self._rendering.draw_in_full_at_rest()
        lacking = [of_class for of_class in self._shown.values() if self._lacks_outline(of_class)]
        begun = [of_class for of_class in lacking if self._outlining and of_class.map is self._outlining[0].map]
        if lacking:
            self._outline((begun or lacking)[0])
        else:
            self._proposals.advance()

    def _follow(self, volume: slicer.vtkMRMLScalarVolumeNode) -> None:
        """Take over the volume and its transform; if either is another one, everything has to be shown again."""
        before = self._volume, self._transform
        self._volume, self._transform = volume, volume.GetTransformNodeID() or ""
        if (self._volume, self._transform) != before:
            self._moved, self._rendered = True, None

    def _lacks_outline(self, of_class: ShownMap) -> bool:
        outlined = self._outlined.get(of_class.class_id)
        return outlined is None or not of_class.is_like(outlined[0])

    def _outline(self, of_class: ShownMap) -> None:
        """Compute some more of one class's contour, and show it when it is complete."""
        outlined = self._outlined.get(of_class.class_id)
        if outlined is not None and outlined[0].map is of_class.map:
            self._take_outline(of_class, outlined[1])
            return
        if self._outlining is None or self._outlining[0].map is not of_class.map:
            self._outlining = of_class, SteppedWork(iso_surface(of_class.map))
        work = self._outlining[1]
        if work.advance():
            self._outlining = None
            self._take_outline(of_class, work.result or [])

    def _take_outline(self, of_class: ShownMap, surface: Surface) -> None:
        """Show a contour at once if it is the first class's, else when none is missing: views cut all contours each time."""
        self._outlined[of_class.class_id] = of_class, surface
        is_first = of_class is next(iter(self._shown.values()))
        if is_first or not any(self._lacks_outline(other) for other in self._shown.values()):
            self._show_contours()

    def _show_contours(self) -> None:
        self._contours.show(self._volume, [(of_class.color, surface) for of_class, surface in self._outlined.values()])

    def _show_overlay(self, of_class: ShownMap | None, opacity: float) -> None:
        if of_class is None or self._volume is None:
            self._overlaid = None
            self._overlay.hide()
            return
        if self._overlaid is not None:
            before, *look = self._overlaid
            if of_class.is_like(before) and look == [opacity, self._transform]:
                return
        self._overlaid = of_class, opacity, self._transform
        self._overlay.show(self._volume, of_class.map, of_class.color, opacity)

    def hide(self) -> None:
        """Hide everything."""
        self._overlay.hide()
        self._contours.hide()
        self._proposals.hide()
        self._rendering.hide()
        self._forget()

    def remove(self) -> None:
        """Remove all nodes of this display from the scene."""
        self._overlay.remove()
        self._contours.remove()
        self._proposals.remove()
        self._rendering.remove()
        self._forget()

    def _forget(self) -> None:
        self._volume = self._overlaid = self._outlining = self._rendered = None
        self._shown, self._outlined = {}, {}


def _hidden(looks: Sequence[Appearance], surroundings: Surroundings) -> frozenset[int]:
    """Indices of the invisible structures, which clicks must pass through.

    If surroundings are visible, there are none: surroundings are seen in place of invisible structures, and clicks hit them.
    """
    if surroundings.visible:
        return frozenset()
    return frozenset(index for index, look in enumerate(looks) if look.opacity <= 0.0)
