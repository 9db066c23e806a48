"""Ctrl and the wheel in a slice view: change the size of the selected structure over it; elsewhere zoom, as in Slicer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import slicer
import vtk

from .view_mouse import SliceMouse

STILL_MM = 3.0
"""In a scan of a body, the mouse counts as unmoved since the last notch within this distance: hands on wheels tremble."""


class SizeWheel:
    """Listens to the wheel in one slice view while active.

    A change of size that begins over the structure continues until the mouse is moved, even if the structure shrinks away from
    under it; otherwise the view would suddenly zoom.

    Args:
        interactor: interactor of the view's render window.
        slice_node: gives the position of the view in the patient.
        selected: returns the id of the class whose size can be changed now; None: there is none.
        is_over: whether a point (3,), RAS millimetres, lies on that class's structure.
        body_scale: returns the factor for lengths that suit human bodies.
        on_notch: called with 1 for a notch away from the user, which means larger, and −1 for one towards them.
    """

    def __init__(
        self,
        interactor: vtk.vtkRenderWindowInteractor,
        slice_node: slicer.vtkMRMLSliceNode,
        selected: Callable[[], str | None],
        is_over: Callable[[np.ndarray], bool],
        body_scale: Callable[[], float],
        on_notch: Callable[[int], None],
    ) -> None:
        self._mouse = SliceMouse(interactor, slice_node)
        self._selected = selected
        self._is_over = is_over
        self._body_scale = body_scale
        self._on_notch = on_notch
        self._last: tuple[str, np.ndarray] | None = None

    def activate(self) -> None:
        """Begin to listen to the wheel."""
        self._mouse.listen({
            vtk.vtkCommand.MouseWheelForwardEvent: lambda: self._turn(1),
            vtk.vtkCommand.MouseWheelBackwardEvent: lambda: self._turn(-1),
        })  # fmt: skip

    def deactivate(self) -> None:
        """Leave the wheel to the view."""
        self._mouse.stop()
        self._last = None

    def _turn(self, notches: int) -> bool:
        selected, point_ras = self._selected(), self._mouse.in_patient(self._mouse.position)
        if (
            selected is None
            or self._mouse.modifiers != {"Ctrl"}
            or not (self._goes_on(selected, point_ras) or self._is_over(point_ras))
        ):
            self._last = None
            return False
        self._last = selected, point_ras
        self._on_notch(notches)
        return True

    def _goes_on(self, selected: str, point_ras: np.ndarray) -> bool:
        if self._last is None:
            return False
        last_selected, last_ras = self._last
        still = float(np.linalg.norm(point_ras - last_ras)) <= self._body_scale() * STILL_MM
        return selected == last_selected and still
