"""A circle of the brush's size about the mouse in a slice view; an actor of the view, not a node of the scene."""

from __future__ import annotations

import numpy as np
import slicer
import vtk

COLOR = (1.0, 1.0, 0.2)
"""As of Slicer's own brush."""

RIM_COLOR = (0.0, 0.0, 0.0)
"""So that the circle is seen on bright tissue, too."""

LINE_PIXELS = 2
RIM_PIXELS = 4
SIDES = 72


class BrushCircle:
    """Invisible until it is moved to a place.

    Args:
        renderer: of the view.
        slice_node: says how large a millimetre is in the view.
        radius_mm: of the circle.
    """

    def __init__(self, renderer: vtk.vtkRenderer, slice_node: slicer.vtkMRMLSliceNode, radius_mm: float) -> None:
        self._renderer = renderer
        self._slice_node = slice_node
        self._radius_mm = radius_mm
        self._circle = vtk.vtkRegularPolygonSource()
        self._circle.SetNumberOfSides(SIDES)
        self._circle.GeneratePolygonOff()
        self._actors = [_actor(self._circle, color, width) for color, width in ((RIM_COLOR, RIM_PIXELS), (COLOR, LINE_PIXELS))]
        for actor in self._actors:
            renderer.AddViewProp(actor)

    def move_to(self, x: float, y: float) -> None:
        """Show the circle about a place in the view, in pixels from the lower left."""
        self._circle.SetCenter(x, y, 0.0)
        self.fit()
        self._set_visibility(True)

    def fit(self) -> None:
        """Bring the circle to its size in millimetres, after the view was zoomed."""
        xy_to_ras = self._slice_node.GetXYToRAS()
        mm_per_pixel = np.linalg.norm([xy_to_ras.GetElement(row, 0) for row in range(3)])
        self._circle.SetRadius(self._radius_mm / mm_per_pixel)

    def hide(self) -> None:
        """Show it no more until it is moved again."""
        self._set_visibility(False)

    def remove(self) -> None:
        """Take it out of the view."""
        for actor in self._actors:
            self._renderer.RemoveViewProp(actor)

    def _set_visibility(self, visible: bool) -> None:
        for actor in self._actors:
            actor.SetVisibility(visible)


def _actor(circle: vtk.vtkRegularPolygonSource, color: tuple[float, float, float], width_pixels: float) -> vtk.vtkActor2D:
    mapper = vtk.vtkPolyDataMapper2D()
    mapper.SetInputConnection(circle.GetOutputPort())
    actor = vtk.vtkActor2D()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*color)
    actor.GetProperty().SetLineWidth(width_pixels)
    actor.VisibilityOff()
    return actor
