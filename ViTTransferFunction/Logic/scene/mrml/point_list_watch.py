"""What happens to lists of points in the scene, by whomever: Slicer's many events, told as the few things that they mean."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import slicer
import vtk

from .observers import SceneObservers


class PointListWatch:
    """Watches lists, and calls back with the list to which something has happened.

    Args:
        on_placed: a point was placed.
        on_step: something else has begun or ended that users take for one step: dragging a point, or deleting it.
        on_passing: a list changes a little at a time: a point is being dragged, a colour being chosen, say.
        on_displayed: a list is new, or displayed otherwise.
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
        # Of points that there are, and of those that were placed.
        self._counts: dict[slicer.vtkMRMLMarkupsFiducialNode, tuple[int, int]] = {}

    def watch(self, lists: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
        """Watch these lists, and no others, for whatever makes them other than they are now.

        To be called again whenever it is known what has become of them.
        """
        for points in lists:
            self._observers.observe(points, self._reactions())
            if points not in self._counts:
                self._on_displayed(points)
        self._observers.keep_only(lists)
        self._counts = {node: (node.GetNumberOfControlPoints(), node.GetNumberOfDefinedControlPoints()) for node in lists}

    @property
    def observer_count(self) -> int:
        """How many observers of lists there are."""
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
        """A point was dragged, say; one that hangs on the mouse, or is just being added, is heard of when it is placed."""
        count, before = self._counts.get(points, (0, 0))
        placed = points.GetNumberOfDefinedControlPoints()
        if count != points.GetNumberOfControlPoints() or placed != points.GetNumberOfDefinedControlPoints(True):
            return
        # Slicer's table of points can unset one, and restore it without saying that it is placed.
        if placed > before:
            self._on_placed(points)
        elif placed < before:
            self._on_step(points)
        else:
            self._on_passing(points)
