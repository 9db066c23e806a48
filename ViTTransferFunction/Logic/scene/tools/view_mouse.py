"""The mouse in a view, for tools that use it in place of the view's own interaction."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import slicer
import vtk

Reaction = Callable[[], bool]
"""Reacts to an event, and returns whether the view must not receive the event."""

_PRIORITY = 100.0
"""Higher than that of the view's own interaction, which must not pan or adjust the window while the user paints or draws."""
PRESSES = (vtk.vtkCommand.LeftButtonPressEvent, vtk.vtkCommand.LeftButtonDoubleClickEvent)
"""The second press of a double click counts as a press, for users who dab twice; the view would maximise itself instead."""


class ViewMouse:
    """Listens to the mouse in one view.

    Args:
        interactor: interactor of the view's render window.
    """

    def __init__(self, interactor: vtk.vtkRenderWindowInteractor) -> None:
        self._interactor = interactor
        self._tags: list[int] = []

    def listen(self, reactions: Mapping[int, Reaction]) -> None:
        """Call the reaction of each of these VTK events, until `stop`."""
        self._tags = [
            self._interactor.AddObserver(event, self._observer(react), _PRIORITY) for event, react in reactions.items()
        ]

    def stop(self) -> None:
        """Leave the mouse to the view."""
        for tag in self._tags:
            self._interactor.RemoveObserver(tag)
        self._tags = []

    @property
    def position(self) -> tuple[float, float]:
        """Position of the mouse, in pixels from the view's lower left corner."""
        x, y = self._interactor.GetEventPosition()
        return float(x), float(y)

    @property
    def modifiers(self) -> set[str]:
        """The held ones of the keys "Ctrl", "Shift" and "Alt", with which Slicer's views are panned, blended and rotated."""
        view = self._interactor
        held = {"Ctrl": view.GetControlKey(), "Shift": view.GetShiftKey(), "Alt": view.GetAltKey()}
        return {key for key, is_held in held.items() if is_held}

    @property
    def renderer(self) -> vtk.vtkRenderer:
        """The view's renderer."""
        return self._interactor.GetRenderWindow().GetRenderers().GetFirstRenderer()

    def _observer(self, react: Reaction) -> Callable[[vtk.vtkObject, str], None]:
        def observe(caller: vtk.vtkObject, event: str) -> None:
            if react():
                self._keep_from_view(caller)

        return observe

    def _keep_from_view(self, caller: vtk.vtkObject) -> None:
        for tag in self._tags:
            command = caller.GetCommand(tag)
            if command is not None:
                command.SetAbortFlag(1)


class SliceMouse(ViewMouse):
    """Listens to the mouse in one slice view.

    Args:
        interactor: interactor of the view's render window.
        slice_node: gives the position of the view in the patient.
    """

    def __init__(self, interactor: vtk.vtkRenderWindowInteractor, slice_node: slicer.vtkMRMLSliceNode) -> None:
        super().__init__(interactor)
        self._slice_node = slice_node

    def in_patient(self, position: tuple[float, float]) -> np.ndarray:
        """The point of the patient at a position in the view, (3,) RAS millimetres."""
        return np.array(self._slice_node.GetXYToRAS().MultiplyPoint((*position, 0.0, 1.0))[:3])
