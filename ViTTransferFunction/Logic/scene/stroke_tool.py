"""Brush strokes in a slice view: the mouse, dragged with the left button held, becomes points along its way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import slicer
import vtk

from .brush_circle import BrushCircle

_ABORT_PRIORITY = 100.0
"""Before the view's own interaction, which must not pan or adjust the window while the user paints."""


class StrokeTool:
    """Paints in one slice view while active, and shows the brush's size about the mouse.

    Args:
        interactor: of the view's render window.
        slice_node: says where the view lies in the patient.
        draw: has the view drawn again soon.
        step_mm: distance along a stroke after which it leaves the next point.
        radius_mm: of the circle about the mouse.
        on_point: gets each point as it is left, (1, 3) RAS millimetres, and whether it continues a stroke.
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
        self._interactor = interactor
        self._slice_node = slice_node
        self._draw = draw
        self._step_mm = step_mm
        self._radius_mm = radius_mm
        self._on_point = on_point
        self._tags: list[int] = []
        self._slice_tag = 0
        self._circle: BrushCircle | None = None
        self._last_ras: np.ndarray | None = None

    def activate(self) -> None:
        """Begin to listen to the mouse."""
        if self._tags:
            return
        for event, react in (
            (vtk.vtkCommand.LeftButtonPressEvent, self._press),
            (vtk.vtkCommand.MouseMoveEvent, self._move),
            (vtk.vtkCommand.LeftButtonReleaseEvent, self._release),
            (vtk.vtkCommand.LeaveEvent, self._leave),
        ):
            self._tags.append(self._interactor.AddObserver(event, react, _ABORT_PRIORITY))
        self._slice_tag = self._slice_node.AddObserver(vtk.vtkCommand.ModifiedEvent, self._on_slice)
        renderer = self._interactor.GetRenderWindow().GetRenderers().GetFirstRenderer()
        self._circle = BrushCircle(renderer, self._slice_node, self._radius_mm)

    def deactivate(self) -> None:
        """Leave the mouse to the view."""
        for tag in self._tags:
            self._interactor.RemoveObserver(tag)
        self._tags.clear()
        self._last_ras = None
        if self._circle is not None:
            self._slice_node.RemoveObserver(self._slice_tag)
            self._circle.remove()
            self._circle = None
            self._draw()

    def _press(self, caller: vtk.vtkObject, event: str) -> None:
        self._leave_point(continued=False)
        self._keep_from_view(caller)

    def _move(self, caller: vtk.vtkObject, event: str) -> None:
        self._move_circle()
        if self._last_ras is None:
            return
        if np.linalg.norm(self._position_ras() - self._last_ras) >= self._step_mm:
            self._leave_point(continued=True)
        self._keep_from_view(caller)

    def _release(self, caller: vtk.vtkObject, event: str) -> None:
        if self._last_ras is None:
            return
        self._last_ras = None
        self._keep_from_view(caller)

    def _leave(self, caller: vtk.vtkObject, event: str) -> None:
        if self._circle is not None:
            self._circle.hide()
            self._draw()

    def _on_slice(self, caller: vtk.vtkObject, event: str) -> None:
        if self._circle is not None:
            self._circle.fit()

    def _move_circle(self) -> None:
        if self._circle is not None:
            self._circle.move_to(*self._interactor.GetEventPosition())
            self._draw()

    def _leave_point(self, continued: bool) -> None:
        self._last_ras = self._position_ras()
        self._on_point(self._last_ras[None], continued)

    def _position_ras(self) -> np.ndarray:
        x, y = self._interactor.GetEventPosition()
        return np.array(self._slice_node.GetXYToRAS().MultiplyPoint((float(x), float(y), 0.0, 1.0))[:3])

    def _keep_from_view(self, caller: vtk.vtkObject) -> None:
        for tag in self._tags:
            command = caller.GetCommand(tag)
            if command is not None:
                command.SetAbortFlag(1)
