"""Brush strokes in a slice view: points are left along the way of the mouse while the left button is held."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import slicer
import vtk

from .brush_circle import BrushCircle
from .view_mouse import PRESSES, SliceMouse


class StrokeTool:
    """Paints in one slice view while active, and shows the brush's size as a circle around the mouse.

    Args:
        interactor: interactor of the view's render window.
        slice_node: gives the position of the view in the patient.
        draw: redraws the view soon.
        step_mm: distance between the points of a stroke.
        radius_mm: radius of the circle around the mouse.
        on_point: called with each new point, (1, 3) RAS millimetres, and whether it continues a stroke.
    """

    def __init__(
        self,
        interactor: vtk.vtkRenderWindowInteractor,
        slice_node: slicer.vtkMRMLSliceNode,
        draw: Callable[[], None],
        step_mm: float,
        radius_mm: float,
        on_point: Callable[[np.ndarray, bool], None],
    ) -> None:
        self._mouse = SliceMouse(interactor, slice_node)
        self._slice_node = slice_node
        self._draw = draw
        self._step_mm = step_mm
        self._radius_mm = radius_mm
        self._on_point = on_point
        self._slice_tag = 0
        self._circle: BrushCircle | None = None
        self._last_ras: np.ndarray | None = None

    def activate(self) -> None:
        """Begin to listen to the mouse."""
        self._mouse.listen({
            **dict.fromkeys(PRESSES, self._press),
            vtk.vtkCommand.MouseMoveEvent: self._move,
            vtk.vtkCommand.LeftButtonReleaseEvent: self._release,
            vtk.vtkCommand.LeaveEvent: self._leave,
            vtk.vtkCommand.EnterEvent: self._enter,
        })  # fmt: skip
        self._slice_tag = self._slice_node.AddObserver(vtk.vtkCommand.ModifiedEvent, self._on_slice)
        self._circle = BrushCircle(self._mouse.renderer, self._slice_node, self._radius_mm)

    def deactivate(self) -> None:
        """Leave the mouse to the view."""
        self._mouse.stop()
        self._last_ras = None
        if self._circle is not None:
            self._slice_node.RemoveObserver(self._slice_tag)
            self._circle.remove()
            self._circle = None
            self._draw()

    def _press(self) -> bool:
        if self._mouse.modifiers:
            return False
        self._leave_point(continued=False)
        return True

    def _move(self) -> bool:
        self._move_circle()
        if self._last_ras is None:
            return False
        if np.linalg.norm(self._position_ras() - self._last_ras) >= self._step_mm:
            self._leave_point(continued=True)
        return True

    def _release(self) -> bool:
        painting, self._last_ras = self._last_ras is not None, None
        return painting

    def _leave(self) -> bool:
        if self._circle is not None:
            self._circle.hide()
            self._draw()
        return False

    def _enter(self) -> bool:
        """With the button held, the mouse enters no view: it was released elsewhere, as where a message came up."""
        self._last_ras = None
        return False

    def _on_slice(self, caller: vtk.vtkObject, event: str) -> None:
        if self._circle is not None:
            self._circle.fit()

    def _move_circle(self) -> None:
        if self._circle is not None:
            self._circle.move_to(*self._mouse.position)
            self._draw()

    def _leave_point(self, continued: bool) -> None:
        self._last_ras = self._position_ras()
        self._on_point(self._last_ras[None], continued)

    def _position_ras(self) -> np.ndarray:
        return self._mouse.in_patient(self._mouse.position)
