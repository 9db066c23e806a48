"""From point to point: all slice views are centred on one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import slicer

from ..mrml.point_lists import Point


class PointTour:
    """Remembers which point was shown last.

    Args:
        scene: all of its slice views are moved; what they show and how large stays as it is.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._scene = scene
        self._shown: Point | None = None

    def show_next(self, points: Sequence[Point]) -> Point | None:
        """Centre the slice views on the point after the one shown last; on the first where that is none of `points`.

        Returns:
            The point, RAS millimetres; None where there are no points.
        """
        if not points:
            return None
        places = list(dict.fromkeys(points))
        index = places.index(self._shown) + 1 if self._shown in places else 0
        self._shown = places[index % len(places)]
        slicer.vtkMRMLSliceNode.JumpAllSlices(self._scene, *self._shown, slicer.vtkMRMLSliceNode.CenteredJumpSlice)
        return self._shown
