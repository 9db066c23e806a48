"""Quick pictures in 3D while a look is being changed: drawn with fewer rays until the hand rests, then in full.

A picture takes as long as it has rays, where OpenGL runs in software. As Slicer does while its own sliders are dragged, views
are asked for more pictures a second; but that only makes the steps of rays longer, which saves little of surfaces, and only in
the quality *Adaptive*. So this also sets how many pixels a ray is for, in views whose pictures take too long to follow a hand.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkImageData

GOAL_S = 0.05
"""How long a picture may take to follow the hand."""

COARSEST = 3
"""Pixels along each edge of the squares that a ray is for, at most: the renderer blends them, and the picture is still good."""

REST_S = 0.2
"""How long after the last change the hand rests; longer than between two steps of a slider that is dragged slowly."""


class QuickPictures:
    """Draws a volume with fewer rays from a change of its look on, until there was none for a moment.

    Args:
        windows: the vtkRenderWindows of the 3D views that are shown.
    """

    def __init__(self, windows: Callable[[], Iterable[Any]]) -> None:
        self._windows = windows
        self._mappers: list[Any] = []
        self._rates: list[tuple[Any, float]] = []
        self._changed_s = 0.0

    @property
    def drawing(self) -> bool:
        """Whether pictures have fewer rays now."""
        return bool(self._mappers)

    def begin(self, image: vtkImageData) -> None:
        """The look of the volume with these voxels changes now."""
        self._changed_s = time.monotonic()
        if self.drawing:
            return
        for window in self._windows():
            for renderer in window.GetRenderers():
                # VTK has -1 s where nothing was drawn yet, as by the renderer of a marker that is hidden.
                last_s = max(renderer.GetLastRenderTimeInSeconds(), 0.0)
                edge = min(math.ceil(math.sqrt(last_s / GOAL_S)), COARSEST)
                if edge > 1:
                    shown = [mapper for mapper in _mappers(renderer) if mapper.GetInputDataObject(0, 0) is image]
                    for mapper in shown:
                        mapper.SetImageSampleDistance(edge)
                    if shown:
                        self._mappers += shown
                        self._hurry(window)

    def end_at_rest(self) -> bool:
        """Let pictures have all rays again if nothing changes any more; whether that is so now, and they are to be drawn."""
        if self.drawing and time.monotonic() - self._changed_s >= REST_S:
            self.end()
            return True
        return False

    def end(self) -> None:
        """Let the next pictures have all rays again."""
        for mapper in self._mappers:
            mapper.SetImageSampleDistance(1.0)
        for window, rate in self._rates:
            window.SetDesiredUpdateRate(rate)
        self._mappers.clear()
        self._rates.clear()

    def _hurry(self, window: Any) -> None:
        """Ask for as many pictures a second as while the view is turned."""
        interactor = window.GetInteractor()
        if interactor is not None:
            self._rates.append((window, interactor.GetStillUpdateRate()))
            window.SetDesiredUpdateRate(interactor.GetDesiredUpdateRate())


@contextmanager
def in_full(renderer: Any) -> Iterator[None]:
    """Have pictures of a vtkRenderer that are drawn meanwhile drawn with all rays: somebody keeps them."""
    before = [(mapper, mapper.GetImageSampleDistance()) for mapper in _mappers(renderer)]
    for mapper, _ in before:
        mapper.SetImageSampleDistance(1.0)
    try:
        yield
    finally:
        for mapper, distance in before:
            mapper.SetImageSampleDistance(distance)


def _mappers(renderer: Any) -> list[Any]:
    """What casts the rays of a view's volumes, of those whose pictures may have fewer."""
    found = (volume.GetMapper() for volume in renderer.GetVolumes())
    return [mapper for mapper in found if mapper is not None and mapper.IsA("vtkGPUVolumeRayCastMapper")]
