"""What a 3D view has in its picture, and having it look at a scan: Slicer's views stay where they are when one is loaded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkBoundingBox

NEARER = 1.4
"""VTK leaves room for the sphere about a volume; bodies fill less of it."""

EDGE = 0.75
"""Of the way from the middle of a picture to its edge: what has its own middle beyond lies to a good part outside of it."""

SMALLEST = 0.1
"""Of a picture's height: what is smaller is a dot. Slicer's 3D views begin with a picture that a body fills."""


def sees(renderer: Any, point_ras: Sequence[float]) -> bool:
    """Whether a point (3,), RAS millimetres, lies well within a view's picture; something may hide it.

    Args:
        renderer: the vtkRenderer of the view.
        point_ras: the point.
    """
    to_picture = renderer.GetActiveCamera().GetCompositeProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1.0, 1.0)
    x, y, _, w = to_picture.MultiplyPoint((*point_ras, 1.0))
    return bool(w > 0.0 and max(abs(x), abs(y)) <= EDGE * w)


def shows_large_enough(renderer: Any, bounds_ras: Sequence[float]) -> bool:
    """Whether a scan is more than a dot in a view that it lies in, as one of an insect is not where the picture is for bodies.

    Args:
        renderer: the vtkRenderer of the view.
        bounds_ras: (6,) of the scan, RAS millimetres, as VTK orders them.
    """
    camera, box = renderer.GetActiveCamera(), vtkBoundingBox(bounds_ras)
    centre = [0.0] * 3
    box.GetCenter(centre)
    height_mm = 2.0 * camera.GetParallelScale()
    if not camera.GetParallelProjection():
        height_mm = 2.0 * math.dist(camera.GetPosition(), centre) * math.tan(math.radians(camera.GetViewAngle()) / 2.0)
    return bool(box.GetDiagonalLength() >= SMALLEST * height_mm)


def look_at(renderer: Any, bounds_ras: Sequence[float]) -> None:
    """Have a view look at a scan, from the direction that it looks in.

    Args:
        renderer: the vtkRenderer of the view.
        bounds_ras: (6,) of the scan, RAS millimetres, as VTK orders them.
    """
    renderer.ResetCamera(bounds_ras)
    renderer.GetActiveCamera().Dolly(NEARER)
    renderer.ResetCameraClippingRange(bounds_ras)


def keep_whole(renderer: Any, bounds_ras: Sequence[float]) -> None:
    """Have the camera cut nothing off of what lies within some bounds, nor of what is shown besides.

    Slicer sets the planes before and behind which nothing is drawn when the view is turned, not when something is added to it.

    Args:
        renderer: the vtkRenderer of the view.
        bounds_ras: (6,), RAS millimetres, as VTK orders them.
    """
    box = vtkBoundingBox(bounds_ras)
    box.AddBounds(renderer.ComputeVisiblePropBounds())
    together = [0.0] * 6
    box.GetBounds(together)
    renderer.ResetCameraClippingRange(together)
