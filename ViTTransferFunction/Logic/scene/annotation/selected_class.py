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
