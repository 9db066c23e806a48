"""The class that is annotated, and whose similarity is overlaid."""

from __future__ import annotations

from .annotations import SceneAnnotations
from .class_state import ClassState
from .parameters import SceneParameters


class SelectedClass:
    """One of the classes of the volume that is chosen; the first one until one is selected.

    Args:
        parameters: keep which.
        annotations: hold the classes.
    """

    def __init__(self, parameters: SceneParameters, annotations: SceneAnnotations) -> None:
        self._parameters = parameters
        self._annotations = annotations

    @property
    def state(self) -> ClassState | None:
        """As it is now; None where there is no class."""
        classes, selected = self._annotations.classes, self._parameters.get("selectedClass")
        return next((state for state in classes if state.id == selected), classes[0] if classes else None)

    def select(self, id_: str) -> None:
        """Choose the class."""
        self._parameters.set("selectedClass", id_)
