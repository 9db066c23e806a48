"""Structures of other scans of the scene, points and all, for the scan that is chosen: where that lies in the same place.

It may be a part of the other one, a copy, another phase, one that was registered to it, or the same, loaded again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import slicer

from ...core.system.errors import InputError
from ..classes.annotated_classes import new_among
from ..classes.class_nodes import class_nodes_of_all, lists_of, read_class, volume_name
from ..classes.class_state import ClassState, new_class_id
from ..classes.of_volume import volume_of
from ..interface.parameters import SceneParameters
from ..interface.translation import tr as _
from .annotations import SceneAnnotations
from .selected_class import SelectedClass


class OtherScans:
    """What can be taken over from them.

    Args:
        parameters: say which scan is chosen.
        annotations: get the structures.
        selected: which class.
        in_volume: tells which of some points (N, 3), RAS millimetres in the scene, lie in the scan that is chosen.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        selected: SelectedClass,
        in_volume: Callable[[np.ndarray], np.ndarray],
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._selected = selected
        self._in_volume = in_volume

    @property
    def names(self) -> dict[str, str]:
        """What users call the scans that have points, by a key; also those that were removed from the scene."""
        names = {}
        chosen = self._parameters.volume
        for positive in class_nodes_of_all(self._parameters.node):
            if volume_of(positive) is not chosen and any(points.GetNumberOfControlPoints() for points in lists_of(positive)):
                name = volume_name(positive)
                removed = _("{name} (removed)").format(name=name)
                names[_key(positive)] = name if volume_of(positive) is not None else removed
        return names

    def take_over(self, key: str) -> None:
        """Add the structures of a scan as they are there, but for close-ups, and select the first; one step for undo.

        Where a structure has the name, and no points yet, it gets theirs. What is there already is left out.

        Args:
            key: one of `names`.

        Raises:
            InputError: none of the points lies in the scan that is chosen, or all is there already.
        """
        theirs = self._with_points(key)
        if not self._have_points_here(theirs):
            text = _("None of the points of '{name}' lies in this scan: the two are not in the same place.")
            raise InputError(text.format(name=self.names.get(key, "")))
        filled, added = self._copies(theirs)
        if not (filled or added):
            raise InputError(_("The structures of that scan are all there already, with the same points and settings."))
        self._annotations.add_classes([*filled, *added])
        self._selected.select((*filled, *added)[0].id)

    def _with_points(self, key: str) -> list[ClassState]:
        """The structures of a scan that have points."""
        of_scan = (read_class(node) for node in class_nodes_of_all(self._parameters.node) if _key(node) == key)
        return [state for state in of_scan if state.positive or state.negative]

    def _have_points_here(self, theirs: Sequence[ClassState]) -> bool:
        points = [point for state in theirs for point in (*state.positive, *state.negative)]
        return bool(points) and bool(self._in_volume(np.array(points)).any())

    def _copies(self, theirs: Sequence[ClassState]) -> tuple[list[ClassState], list[ClassState]]:
        """Copies for the scan that is chosen: those that fill structures without points there, and those to be added."""
        present = self._annotations.classes
        empty = {state.name: state.id for state in present if not (state.positive or state.negative)}
        # Each once: of scans of one name that were removed, there may be several structures of one name.
        copies = [_copy(state, empty.pop(state.name, "") or new_class_id()) for state in theirs]
        known = {state.id for state in present}
        filled = [state for state in copies if state.id in known]
        return filled, new_among([state for state in copies if state.id not in known], [*present, *filled])


def _copy(state: ClassState, id_: str) -> ClassState:
    """A structure for the same place in another scan. Boxes lie along the axes of the scan that they were chosen in."""
    return replace(state, id=id_, close_up=None, continues="", visible=True)


def _key(positive: slicer.vtkMRMLMarkupsFiducialNode) -> str:
    volume = volume_of(positive)
    return volume.GetID() if volume is not None else f"removed {volume_name(positive)}"
