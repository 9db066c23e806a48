"""What the views show of a session: overlay and contours in the slice views, a rendering in the 3D views."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import slicer

from ..compute.exchange import ShownMap
from .classes import ClassState
from .contours import Contours, Outline
from .overlay import SimilarityOverlay
from .rendering import ClassRendering


class SceneDisplay:
    """Derived nodes, which are made when they are first needed and taken away in the end.

    Args:
        scene: the scene.
        app_logic: the application's logic, which has the volume rendering's.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic) -> None:
        self._overlay = SimilarityOverlay(scene)
        self._contours = Contours(scene)
        self._rendering = ClassRendering(scene, app_logic)
        self._volume: slicer.vtkMRMLScalarVolumeNode | None = None
        self._overlaid: tuple[Any, ...] = ()
        self._outlines: dict[str, Outline] = {}
        self._outlined: dict[str, Outline] = {}
        self._transform = ""
        self._rendered: tuple[Any, ...] = ()

    def show_maps(
        self,
        volume: slicer.vtkMRMLScalarVolumeNode,
        maps: Sequence[tuple[ClassState, ShownMap]],
        overlaid: str | None,
        overlay_opacity: float,
    ) -> None:
        """Show the contours of all `maps`, and the one of the class whose id is `overlaid` as a coloured overlay.

        The overlay is there at once, and its class's contour; the other contours follow one by one, by `advance`.
        """
        self._volume = volume
        self._outlines = {s.id: (s.id, m.array, m.ijk_to_ras, m.iso, s.color) for s, m in maps}
        self._show_overlay(self._outlines.get(overlaid or ""), overlay_opacity)
        transform = volume.GetTransformNodeID() or ""
        if transform != self._transform or self._outlined.keys() - self._outlines.keys():
            self._transform = transform
            self._outlined = {id_: self._outlined[id_] for id_ in self._outlines if id_ in self._outlined}
            self._contours.show(volume, list(self._outlined.values()))
        if overlaid in self._outlines:
            self._outline(overlaid)

    @property
    def pending(self) -> bool:
        """Whether there are contours still to be shown."""
        return any(not _same(outline, self._outlined.get(id_)) for id_, outline in self._outlines.items())

    def advance(self) -> None:
        """Bring the next contour up to date: some hundredths of a second of work."""
        for id_, outline in self._outlines.items():
            if not _same(outline, self._outlined.get(id_)):
                self._outline(id_)
                return

    def _show_overlay(self, outline: Outline | None, opacity: float) -> None:
        wanted = (*outline, opacity, self._volume.GetTransformNodeID()) if outline and self._volume else ()
        if _same(wanted, self._overlaid):
            return
        self._overlaid = wanted
        if outline:
            _, array, ijk_to_ras, iso, color = outline
            self._overlay.show(self._volume, array, ijk_to_ras, iso, color, opacity)
        else:
            self._overlay.hide()

    def _outline(self, id_: str) -> None:
        """Bring the contour of one class up to date; the others stay as they are."""
        if not _same(self._outlines[id_], self._outlined.get(id_)):
            self._outlined[id_] = self._outlines[id_]
            self._contours.show(self._volume, list(self._outlined.values()))

    def show_rendering(self, volume: slicer.vtkMRMLScalarVolumeNode, rendering: tuple[np.ndarray, np.ndarray] | None) -> None:
        """Show a volume of colours (K, J, I, 4) with its IJK-to-RAS matrix in the 3D views; None: nothing."""
        wanted = (*rendering, volume.GetTransformNodeID()) if rendering else ()
        if _same(wanted, self._rendered):
            return
        self._rendered = wanted
        if rendering is None:
            self._rendering.hide()
        else:
            self._rendering.show(volume, *rendering)

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
        self._volume = None
        self._overlaid, self._rendered, self._outlines, self._outlined = (), (), {}, {}


def _same(one: tuple[Any, ...], other: tuple[Any, ...] | None) -> bool:
    """Whether two descriptions of what is shown are equal, arrays being equal where they are the same object."""
    if other is None or len(one) != len(other):
        return False
    return all(a is b if isinstance(a, np.ndarray) else a == b for a, b in zip(one, other, strict=True))
