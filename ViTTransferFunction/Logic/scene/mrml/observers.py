"""Observers of scene nodes that are taken off again, all at once, when whoever set them ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import vtk


class SceneObservers:
    """Keeps track of which nodes are observed, so that none is observed twice and none is forgotten."""

    def __init__(self) -> None:
        self._tags: dict[vtk.vtkObject, list[int]] = {}

    def observe(
        self,
        node: vtk.vtkObject,
        reactions: Iterable[tuple[int | str, Callable[[vtk.vtkObject, str], None]]],
        priority: float = 0.0,
    ) -> None:
        """Call each reaction on its event of `node`; nothing happens where the node is observed already.

        Args:
            node: what is observed.
            reactions: events, and what is called with the node and the event's name.
            priority: of several observers, those of a higher one are called first.
        """
        if node not in self._tags:
            self._tags[node] = [node.AddObserver(event, reaction, priority) for event, reaction in reactions]

    def keep_only(self, nodes: Iterable[vtk.vtkObject]) -> None:
        """Stop observing everything but `nodes`."""
        kept = set(nodes)
        for node in [node for node in self._tags if node not in kept]:
            for tag in self._tags.pop(node):
                node.RemoveObserver(tag)

    @property
    def count(self) -> int:
        """How many observers there are."""
        return sum(len(tags) for tags in self._tags.values())

    def remove_all(self) -> None:
        """Stop observing."""
        self.keep_only([])
