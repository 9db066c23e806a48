"""Regions drawn in a slice view: the mouse, dragged with the left button held, draws a lasso or a box."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import slicer
import vtk

from ..core.colors import Color
from .view_mouse import PRESSES, ViewMouse

Shape = Literal["lasso", "box"]

_STEP_PIXELS = 3.0
"""Corners of a lasso are this far apart."""
_SMALLEST_PIXELS = 5.0
"""What is smaller than this in both directions was a click, not a region."""


class RegionTool:
    """Draws regions in one slice view while active, and shows the outline as it grows.

    Args:
        interactor: of the view's render window.
        slice_node: says where the view lies in the patient.
        draw: has the view drawn again soon.
        shape: what a drag draws.
        color: of the outline.
        on_region: gets each outline when the button is released, (N, 3) RAS millimetres in the plane of the slice.
    """

    def __init__(
        self,
        interactor: vtk.vtkRenderWindowInteractor,
        slice_node: slicer.vtkMRMLSliceNode,
        draw: Callable[[], None],
        shape: Shape,
        color: Color,
        on_region: Callable[[np.ndarray], None],
    ) -> None:
        self._mouse = ViewMouse(interactor, slice_node)
        self._shape = shape
        self._on_region = on_region
        self._draw = draw
        self._path: list[tuple[float, float]] = []
        self._line = _Line(color)

    def activate(self) -> None:
        """Begin to listen to the mouse."""
        if not self._mouse.listens:
            self._mouse.listen({
                **dict.fromkeys(PRESSES, self._press),
                vtk.vtkCommand.MouseMoveEvent: self._move,
                vtk.vtkCommand.LeftButtonReleaseEvent: self._release,
            })  # fmt: skip

    def deactivate(self) -> None:
        """Leave the mouse to the view; what is being drawn is given up."""
        self._mouse.stop()
        self._end()

    def _press(self) -> bool:
        if self._mouse.modifiers:
            return False
        self._path = [self._mouse.position]
        self._line.add_to(self._mouse.renderer)
        return True

    def _move(self) -> bool:
        if not self._path:
            return False
        position = self._mouse.position
        if self._shape == "box":
            self._path = [self._path[0], position]
        elif np.hypot(*np.subtract(position, self._path[-1])) >= _STEP_PIXELS:
            self._path.append(position)
        self._line.show(self._outline())
        self._draw()
        return True

    def _release(self) -> bool:
        if not self._path:
            return False
        outline = self._outline()
        self._end()
        if np.ptp(outline, axis=0).max() >= _SMALLEST_PIXELS:
            self._on_region(np.array([self._mouse.in_patient((x, y)) for x, y in outline.tolist()]))
        return True

    def _end(self) -> None:
        if self._path:
            self._path = []
            self._line.remove()
            self._draw()

    def _outline(self) -> np.ndarray:
        """Corners of the region, (N, 2) pixels of the view."""
        if self._shape == "lasso":
            return np.array(self._path)
        (left, bottom), (right, top) = self._path[0], self._path[-1]
        return np.array([(left, bottom), (right, bottom), (right, top), (left, top)])


class _Line:
    """A closed line in a renderer, in its pixels."""

    def __init__(self, color: Color) -> None:
        self._renderer: vtk.vtkRenderer | None = None
        self._polygon = vtk.vtkPolyData()
        mapper = vtk.vtkPolyDataMapper2D()
        mapper.SetInputData(self._polygon)
        self._actor = vtk.vtkActor2D()
        self._actor.SetMapper(mapper)
        self._actor.GetProperty().SetColor(*color)
        self._actor.GetProperty().SetLineWidth(2.0)

    def add_to(self, renderer: vtk.vtkRenderer | None) -> None:
        """Draw into this renderer from now on; there is nothing to see until `show`."""
        self.remove()
        self._renderer = renderer
        self._polygon.Initialize()
        if renderer is not None:
            renderer.AddViewProp(self._actor)

    def show(self, corners: np.ndarray) -> None:
        """Go through these corners (N, 2), pixels of the renderer's window, and back to the first."""
        points, cells = vtk.vtkPoints(), vtk.vtkCellArray()
        origin = self._renderer.GetOrigin() if self._renderer is not None else (0, 0)
        for x, y in corners - np.array(origin):
            points.InsertNextPoint(x, y, 0.0)
        cells.InsertNextCell(len(corners) + 1)
        for index in (*range(len(corners)), 0):
            cells.InsertCellPoint(index)
        self._polygon.SetPoints(points)
        self._polygon.SetLines(cells)

    def remove(self) -> None:
        """Take the line out of its renderer."""
        if self._renderer is not None:
            self._renderer.RemoveViewProp(self._actor)
            self._renderer = None
