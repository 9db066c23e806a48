"""What the views show of a session: overlay and contours in the slice views, a rendering in the 3D views."""

from __future__ import annotations

from collections.abc import Sequence

import slicer

from ..compute.requests import ColorVolume
from .contours import Contours, ShownMap
from .overlay import SimilarityOverlay
from .rendering import ClassRendering


class SceneDisplay:
    """Derived nodes, which are made when they are first needed and taken away in the end.

    Args:
        scene: the scene.
        app_logic: the application's logic, which has those of the slice views and of the volume rendering.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic) -> None:
        self._overlay = SimilarityOverlay(scene, app_logic)
        self._contours = Contours(scene)
        self._rendering = ClassRendering(scene, app_logic)
        self._volume: slicer.vtkMRMLScalarVolumeNode | None = None
        self._overlaid: tuple[ShownMap, float, str] | None = None
        self._shown: dict[str, ShownMap] = {}
        self._outlined: dict[str, ShownMap] = {}
        self._transform = ""
        self._rendered: tuple[ColorVolume, str] | None = None

    def show_maps(
        self,
        volume: slicer.vtkMRMLScalarVolumeNode,
        shown: Sequence[ShownMap],
        overlaid: str | None,
        overlay_opacity: float,
    ) -> None:
        """Show the contours of these classes, and the map of the one whose id is `overlaid` as a coloured overlay.

        The overlay is there at once, and its class's contour; the other contours follow one by one, by `advance`.
        """
        self._volume = volume
        self._shown = {of_class.class_id: of_class for of_class in shown}
        self._show_overlay(self._shown.get(overlaid or ""), overlay_opacity)
        transform = volume.GetTransformNodeID() or ""
        if transform != self._transform or self._outlined.keys() - self._shown.keys():
            self._transform = transform
            self._outlined = {id_: self._outlined[id_] for id_ in self._shown if id_ in self._outlined}
            self._contours.show(volume, list(self._outlined.values()))
        if overlaid in self._shown:
            self._outline(overlaid)

    @property
    def pending(self) -> bool:
        """Whether there are contours still to be shown."""
        return any(not of_class.is_like(self._outlined.get(id_)) for id_, of_class in self._shown.items())

    def advance(self) -> None:
        """Bring the next contour up to date: some hundredths of a second of work."""
        for id_, of_class in self._shown.items():
            if not of_class.is_like(self._outlined.get(id_)):
                self._outline(id_)
                return

    def _show_overlay(self, of_class: ShownMap | None, opacity: float) -> None:
        if of_class is None or self._volume is None:
            self._overlaid = None
            self._overlay.hide()
            return
        transform = self._volume.GetTransformNodeID() or ""
        if self._overlaid is not None:
            before, *look = self._overlaid
            if of_class.is_like(before) and look == [opacity, transform]:
                return
        self._overlaid = of_class, opacity, transform
        self._overlay.show(self._volume, of_class.map, of_class.color, opacity)

    def _outline(self, id_: str) -> None:
        """Bring the contour of one class up to date; the others stay as they are."""
        if not self._shown[id_].is_like(self._outlined.get(id_)):
            self._outlined[id_] = self._shown[id_]
            self._contours.show(self._volume, list(self._outlined.values()))

    def show_rendering(self, volume: slicer.vtkMRMLScalarVolumeNode, rendering: ColorVolume | None) -> None:
        """Show a volume of colours in the 3D views; None: nothing."""
        transform = volume.GetTransformNodeID() or ""
        if rendering is None:
            self._rendered = None
            self._rendering.hide()
            return
        if self._rendered is not None and self._rendered[0] is rendering and self._rendered[1] == transform:
            return
        self._rendered = rendering, transform
        self._rendering.show(volume, rendering.rgba, rendering.geometry.ijk_to_ras)

    def hide(self) -> None:
        """Show nothing."""
        self._overlay.hide()
        self._contours.hide()
        self._rendering.hide()
        self._forget()

    def remove(self) -> None:
        """Take all that was made out of the scene."""
        self._overlay.remove()
        self._contours.remove()
        self._rendering.remove()
        self._forget()

    def _forget(self) -> None:
        self._volume = self._overlaid = self._rendered = None
        self._shown, self._outlined = {}, {}
