"""Shapes drawn in a slice view: the mouse, dragged with the left button held, draws a lasso, a box, or a straight line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import slicer
import vtk

from ...core.classes.colors import Color
from ...core.volumes.measures import two_figures
from .drawn_outline import DrawnOutline
from .view_mouse import PRESSES, SliceMouse

Shape = Literal["lasso", "box", "line"]

_WHEEL = (vtk.vtkCommand.MouseWheelForwardEvent, vtk.vtkCommand.MouseWheelBackwardEvent)
_STEP_PIXELS = 3.0
"""Corners of a lasso are this far apart."""
_SMALLEST_PIXELS = 5.0
"""What is smaller than this in both directions was a click, not a shape."""


class DrawingTool:
    """Draws shapes in one slice view while active, and shows each as it grows; of a line, also how long it is.

    Args:
        interactor: of the view's render window.
        slice_node: says where the view lies in the patient.
        draw: has the view drawn again soon.
        shape: what a drag draws.
        color: of the outline.
        on_drawn: gets the corners of each shape when the button is released, (N, 3) RAS millimetres in the plane of the slice;
            of a line, both ends, from the first to the last.
        on_click: called where the button was pressed and released, but nothing drawn.
    """

    def __init__(
        self,
        interactor: vtk.vtkRenderWindowInteractor,
        slice_node: slicer.vtkMRMLSliceNode,
        draw: Callable[[], None],
        shape: Shape,
        color: Color,
        on_drawn: Callable[[np.ndarray], None],
        on_click: Callable[[], None],
    ) -> None:
        self._mouse = SliceMouse(interactor, slice_node)
        self._shape = shape
        self._on_drawn = on_drawn
        self._on_click = on_click
        self._draw = draw
        self._path: list[tuple[float, float]] = []
        self._outline = DrawnOutline(color)

    def activate(self) -> None:
        """Begin to listen to the mouse."""
        self._mouse.listen({
            **dict.fromkeys(PRESSES, self._press),
            vtk.vtkCommand.MouseMoveEvent: self._move,
            vtk.vtkCommand.LeftButtonReleaseEvent: self._release,
            vtk.vtkCommand.EnterEvent: self._enter,
            **dict.fromkeys(_WHEEL, self._wheel),
        })  # fmt: skip

    def deactivate(self) -> None:
        """Leave the mouse to the view; what is being drawn is given up."""
        self._mouse.stop()
        self._end()

    def _press(self) -> bool:
        if self._mouse.modifiers:
            return False
        self._path = [self._mouse.position]
        self._outline.add_to(self._mouse.renderer)
        return True

    def _move(self) -> bool:
        if not self._path:
            return False
        position = self._mouse.position
        if self._shape != "lasso":
            self._path = [self._path[0], position]
        elif np.hypot(*np.subtract(position, self._path[-1])) >= _STEP_PIXELS:
            self._path.append(position)
        self._outline.show(self._corners(), self._length_text())
        self._draw()
        return True

    def _release(self) -> bool:
        if not self._path:
            return False
        corners = self._corners()
        self._end()
        if np.ptp(corners, axis=0).max() >= _SMALLEST_PIXELS:
            self._on_drawn(self._in_patient(corners))
        else:
            self._on_click()
        return True

    def _enter(self) -> bool:
        """With the button held, the mouse enters no view: it was released elsewhere, as where a message came up."""
        self._end()
        return False

    def _wheel(self) -> bool:
        """It leads to another slice, and hands that drag turn it by mistake: what is drawn lies in the one that it began in."""
        return bool(self._path)

    def _end(self) -> None:
        if self._path:
            self._path = []
            self._outline.remove()
            self._draw()

    def _corners(self) -> np.ndarray:
        """Corners of the shape, (N, 2) pixels of the view."""
        if self._shape == "lasso":
            return np.array(self._path)
        (left, bottom), (right, top) = self._path[0], self._path[-1]
        if self._shape == "line":
            return np.array([(left, bottom), (right, top)])
        return np.array([(left, bottom), (right, bottom), (right, top), (left, top)])

    def _length_text(self) -> str:
        if self._shape != "line":
            return ""
        start, end = self._in_patient(self._corners())
        return f"{two_figures(float(np.linalg.norm(end - start)), least_decimals=1)} mm"

    def _in_patient(self, corners: np.ndarray) -> np.ndarray:
        return np.array([self._mouse.in_patient((x, y)) for x, y in corners.tolist()])
