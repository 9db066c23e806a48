"""Watches lists of points in the scene, whoever changes them, and reduces Slicer's many events to the four that matter."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import slicer
import vtk

from .observers import SceneObservers


class PointListWatch:
    """Watches lists of points, and calls one of four functions with the list that has changed.

    Args:
        on_placed: a point was placed.
        on_step: something else began or ended that is one step to the user: a point was grabbed, let go or deleted.
        on_passing: the list changed as one of a quick succession of changes, for example while a point is dragged or a colour
            is chosen.
        on_displayed: the list is new, or is displayed differently.
    """

    def __init__(
        self,
        on_placed: Callable[[slicer.vtkMRMLMarkupsFiducialNode], None],
        on_step: Callable[[slicer.vtkMRMLMarkupsFiducialNode], None],
        on_passing: Callable[[slicer.vtkMRMLMarkupsFiducialNode], None],
        on_displayed: Callable[[slicer.vtkMRMLMarkupsFiducialNode], None],
    ) -> None:
        self._on_placed = on_placed
        self._on_step = on_step
        self._on_passing = on_passing
        self._on_displayed = on_displayed
        self._observers = SceneObservers()
        # For each list, the number of its points, and of those among them that have a position.
        self._counts: dict[slicer.vtkMRMLMarkupsFiducialNode, tuple[int, int]] = {}

    def watch(self, lists: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
        """Watch these lists and no others; changes are counted from their present state.

        Call it again after each change has been taken in.
        """
        for points in lists:
            self._observers.observe(points, self._reactions())
            if points not in self._counts:
                self._on_displayed(points)
        self._observers.keep_only(lists)
        self._counts = {node: (node.GetNumberOfControlPoints(), node.GetNumberOfDefinedControlPoints()) for node in lists}

    @property
    def observer_count(self) -> int:
        """The number of observers on lists."""
        return self._observers.count

    def close(self) -> None:
        """Stop watching."""
        self._observers.remove_all()

    def _reactions(self) -> list[tuple[int | str, Callable[[vtk.vtkObject, str], None]]]:
        markups, displayed = slicer.vtkMRMLMarkupsNode, slicer.vtkMRMLDisplayableNode.DisplayModifiedEvent
        steps = (markups.PointStartInteractionEvent, markups.PointEndInteractionEvent, markups.PointRemovedEvent)
        passing = ("ModifiedEvent", displayed, slicer.vtkMRMLTransformableNode.TransformModifiedEvent)
        return [
            (markups.PointPositionDefinedEvent, lambda points, event: self._on_placed(points)),
            (markups.PointModifiedEvent, lambda points, event: self._on_moved(points)),
            (displayed, lambda points, event: self._on_displayed(points)),
            *((event, lambda points, event: self._on_step(points)) for event in steps),
            *((event, lambda points, event: self._on_passing(points)) for event in passing),
        ]

    def _on_moved(self, points: slicer.vtkMRMLMarkupsFiducialNode) -> None:
        """A point was moved. One that hangs on the mouse or is being added does not count yet: `on_placed` follows."""
        count, before = self._counts.get(points, (0, 0))
        placed = points.GetNumberOfDefinedControlPoints()
        if count != points.GetNumberOfControlPoints() or placed != points.GetNumberOfDefinedControlPoints(True):
            return
        # Slicer's table of points can unset a point, and set it again without the event for a placed point.
        if placed > before:
            self._on_placed(points)
        elif placed < before:
            self._on_step(points)
        else:
            self._on_passing(points)
