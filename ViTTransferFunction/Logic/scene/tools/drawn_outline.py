"""A shape while it is drawn in a slice view, with a text beside its end: actors of the view, not nodes of the scene."""

from __future__ import annotations

import numpy as np
import vtk

from ...core.classes.colors import Color

LINE_POINTS = 2.0
"""Width of the line, in points as the other sizes: pixels of ordinary screens. Denser ones show it as large."""
FONT_POINTS = 14
TEXT_DISTANCE_POINTS = 14.0
"""Between the text and the line: beside the mouse's pointer, not below it."""
POINTS_PER_INCH = 72.0
"""VTK's resolution where a point is a pixel, as one of a page is on an ordinary screen."""


class DrawnOutline:
    """A closed line in a renderer, in its pixels; one of two corners is straight.

    Args:
        color: of the line.
    """

    def __init__(self, color: Color) -> None:
        self._renderer: vtk.vtkRenderer | None = None
        self._lines = vtk.vtkPolyData()
        mapper = vtk.vtkPolyDataMapper2D()
        mapper.SetInputData(self._lines)
        self._actor = vtk.vtkActor2D()
        self._actor.SetMapper(mapper)
        self._actor.GetProperty().SetColor(*color)
        self._text = _text_actor()

    def add_to(self, renderer: vtk.vtkRenderer | None) -> None:
        """Draw into this renderer from now on; there is nothing to see until `show`."""
        self.remove()
        self._renderer = renderer
        self._lines.Initialize()
        self._actor.GetProperty().SetLineWidth(LINE_POINTS * self._pixels_per_point)
        self._text.VisibilityOff()
        if renderer is not None:
            renderer.AddViewProp(self._actor)
            renderer.AddViewProp(self._text)

    def show(self, corners: np.ndarray, text: str) -> None:
        """Go through these corners (N, 2), pixels of the renderer's window, and back to the first; text beside the last one."""
        if self._renderer is None:
            return
        corners = corners - np.array(self._renderer.GetOrigin())
        points, cells = vtk.vtkPoints(), vtk.vtkCellArray()
        for x, y in corners:
            points.InsertNextPoint(x, y, 0.0)
        cells.InsertNextCell(len(corners) + 1)
        for index in (*range(len(corners)), 0):
            cells.InsertCellPoint(index)
        self._lines.SetPoints(points)
        self._lines.SetLines(cells)
        self._show_text(text, corners)

    def remove(self) -> None:
        """Take it out of its renderer."""
        if self._renderer is not None:
            self._renderer.RemoveViewProp(self._actor)
            self._renderer.RemoveViewProp(self._text)
            self._renderer = None

    @property
    def _pixels_per_point(self) -> float:
        return self._renderer.GetRenderWindow().GetDPI() / POINTS_PER_INCH if self._renderer is not None else 1.0

    def _show_text(self, text: str, corners: np.ndarray) -> None:
        """Left of the last corner, seen along the way there: it covers neither the line nor what the mouse aims at."""
        self._text.SetVisibility(bool(text))
        if not text or self._renderer is None:
            return
        self._text.SetInput(text)
        size = np.zeros(2)
        self._text.GetSize(self._renderer, size)
        way = corners[-1] - corners[0]
        to_left = np.array([-way[1], way[0]]) / max(np.hypot(*way), 1.0)
        middle = corners[-1] + to_left * (np.abs(to_left) @ size / 2 + TEXT_DISTANCE_POINTS * self._pixels_per_point)
        self._text.SetPosition(*np.clip(middle, size / 2, np.maximum(np.array(self._renderer.GetSize()) - size / 2, size / 2)))


def _text_actor() -> vtk.vtkTextActor:
    """White on dark, to be read on any image; its position is its middle."""
    actor = vtk.vtkTextActor()
    look = actor.GetTextProperty()
    look.SetFontSize(FONT_POINTS)
    look.BoldOn()
    look.SetColor(1.0, 1.0, 1.0)
    look.SetBackgroundColor(0.0, 0.0, 0.0)
    look.SetBackgroundOpacity(0.6)
    look.SetJustificationToCentered()
    look.SetVerticalJustificationToCentered()
    return actor
