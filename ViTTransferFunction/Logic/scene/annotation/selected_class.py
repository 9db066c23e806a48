"""The class that is annotated, and whose similarity is overlaid."""

from __future__ import annotations

from ..classes.class_state import ClassState
from ..interface.parameters import SceneParameters
from .annotations import SceneAnnotations


class SelectedClass:
    """One of the classes of the volume that is chosen; the first one until one is selected.

    Where the selected one is gone, as when its adding is undone, it is again the one that was selected before.

    Args:
        parameters: keep which.
        annotations: hold the classes.
    """

    def __init__(self, parameters: SceneParameters, annotations: SceneAnnotations) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._before: tuple[str, ...] = ()

    @property
    def state(self) -> ClassState | None:
        """As it is now; None where there is no class."""
        classes = self._annotations.classes
        by_id = {state.id: state for state in classes}
        selected = (self._parameters.get("selectedClass"), *reversed(self._before))
        return next((by_id[id_] for id_ in selected if id_ in by_id), classes[0] if classes else None)

    def select(self, id_: str) -> None:
        """Choose the class."""
        if (state := self.state) is not None:
            self._before = (*(before for before in self._before if before != state.id), state.id)
        self._parameters.set("selectedClass", id_)

    def select_neighbour(self, step: int) -> None:
        """Choose the class `step` rows further down; the table's ends meet."""
        state, ids = self.state, [each.id for each in self._annotations.classes]
        if state is not None:
            self.select(ids[(ids.index(state.id) + step) % len(ids)])

    def duplicate(self, id_: str) -> None:
        """Add a class with the settings and points of another one below it, and choose it."""
        self.select(self._annotations.duplicate_class(id_).id)

    def remove(self, id_: str) -> None:
        """Remove a class and its points; where it was the chosen one, choose the one that takes its row, or else the last."""
        state, row = self.state, [each.id for each in self._annotations.classes].index(id_)
        self._annotations.remove_class(id_)
        left = self._annotations.classes
        if left and state is not None and state.id == id_:
            self.select(left[min(row, len(left) - 1)].id)
