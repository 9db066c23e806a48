"""Close-ups of structures that are small or thin in the whole volume: sets, moves and clears their boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...compute.proxy import SegmentationProxy
from ...core.classes.close_up import CloseUp, EdgesMm
from ...core.classes.close_up_choice import close_up_of
from ...core.system.errors import InputError
from ...core.volumes.geometry import transform_points
from ..classes.class_state import ClassState, CloseUpBox
from ..interface.notices import Notices
from ..interface.number_texts import close_up_text
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..mrml.nodes import in_text
from ..mrml.transforms import matrix_to_world
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .asked_maps import AskedMaps

_SAME_MM = 1e-3
"""Tolerance for points that a transform has moved; rounding is less."""


@dataclass(frozen=True, eq=False)
class _Place:
    """Positions of a class's points, (N, 3) RAS millimetres, and the transform (4, 4) that their list is under."""

    points: np.ndarray
    to_world: np.ndarray


class SceneCloseUps:
    """Sets and clears the boxes of classes' close-ups; each change is a step of its own for undo.

    Args:
        parameters: give the chosen volume.
        annotations: hold the classes, and with them the boxes.
        volume: the open volume.
        maps: has the last requests.
        proxy: has the maps from which boxes are chosen, and requests the close-ups.
        problems: gets the reason why there cannot be a close-up of a class.
        notices: informs front ends of changes.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        volume: OpenedVolume,
        maps: AskedMaps,
        proxy: SegmentationProxy,
        problems: Problems,
        notices: Notices,
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._volume = volume
        self._maps = maps
        self._proxy = proxy
        self._problems = problems
        self._notices = notices
        self._shown: dict[str, CloseUpBox | None] = {}
        self._places: dict[tuple[str, str], _Place] = {}  # By IDs of volume and class, because another volume may be chosen.

    def look_closer(self, id_: str) -> None:
        """Set a class's box around the structure as it is shown now, or tell the user why this is not possible.

        The box's features take a few seconds, during which the map of the whole volume is shown. Called again, the method fits
        the box to the structure as it is shown by then.
        """
        self._problems.solve("close-up")  # So that the user is told of the same problem again.
        content, class_map, request = self._volume.content, self._proxy.maps.get(id_), self._maps.requests.of(id_)
        name = in_text(next(state.name for state in self._annotations.classes if state.id == id_))
        if content is None or class_map is None or request is None:
            self._problems.put("close-up", f"Place a point on {name} first, and wait until it is shown.")
        else:
            try:
                self.look_at(id_, close_up_of(class_map, request.positive, content.geometry))
            except InputError as error:
                self._problems.put("close-up", f"{name}: {error}")
        self._notices.tell()

    def look_at(self, id_: str, close_up: CloseUp) -> None:
        """Set a class's box, given in the local frame of the open volume.

        Raises:
            InputError: the volume is under a transform that is not linear, or that makes it flat (`matrix_to_world`).
        """
        self._problems.solve("close-up")
        # If a close-up of the same box failed before, the requests do not change, and nothing else would repeat it.
        self._proxy.try_close_ups_again()
        to_world = matrix_to_world(self._parameters.volume)
        centre = transform_points(to_world, np.array(close_up.centre_ras))[0].tolist()
        self._annotations.set_close_up(id_, (*centre, *close_up.size_mm))

    def look_at_whole(self, id_: str) -> None:
        """Clear a class's box, so that the whole volume is used again."""
        self._problems.solve("close-up")
        self._annotations.set_close_up(id_, None)

    def size_mm(self, state: ClassState) -> EdgesMm | None:
        """Edges of a class's box, as enlarged by points outside it; None: the class has no box.

        Without a volume, or a point of the class in it, these are the edges of the box as it was set.
        """
        content, request = self._volume.content, self._maps.requests.of(state.id)
        if content is None or request is None or request.close_up is None:
            return None if state.close_up is None else state.close_up[3:]
        return request.close_up.enlarged(content.geometry, request.positive).size_mm

    def failed(self, state: ClassState) -> bool:
        """Whether a class is shown from the whole volume because its close-up failed."""
        return state.close_up is not None and state.id in self._proxy.failed_close_ups

    def text(self, state: ClassState) -> str:
        """A text about a class's box; "" if it has none."""
        return close_up_text(self.size_mm(state), self.failed(state))

    def go_along(self) -> None:
        """Move the boxes of classes whose points a transform, such as the volume's, has moved since the last call.

        This is not done at each change, because hardening a transform moves points twice, there and back.
        """
        moved: dict[str, CloseUpBox] = {}
        volume_id = self._parameters.volume.GetID() if self._parameters.volume else ""
        for state in self._annotations.classes:
            before = self._places.pop((volume_id, state.id), None)
            if state.close_up is None or (now := self._place(state)) is None:
                continue
            self._places[volume_id, state.id] = now
            change = _change(before, now)
            if change is not None:
                moved[state.id] = _moved(state.close_up, change)
                shown = self._shown.get(state.id)
                self._shown[state.id] = None if shown is None else _moved(shown, change)
        if moved:
            self._annotations.move_close_ups(moved)

    def forget(self) -> None:
        """Forget all positions, because there is another scene."""
        self._places.clear()
        self._shown.clear()

    def _place(self, state: ClassState) -> _Place | None:
        """Positions of a class's points; None if their list is under a transform that `matrix_to_world` refuses."""
        try:
            to_world = matrix_to_world(self._annotations.points_node(state.id, positive=True))
        except InputError:
            return None
        return _Place(np.array(state.positive).reshape(-1, 3), to_world)

    def remember_shown(self) -> None:
        """Remember the box in which each class is shown, except those whose close-ups are awaited."""
        awaited = self._proxy.awaiting_close_ups
        self._shown |= {state.id: state.close_up for state in self._annotations.classes if state.id not in awaited}

    def take_back(self) -> None:
        """Cancel the close-ups that are awaited: set each class's box back to the one in which it is shown, or clear it.

        Otherwise a class would have a box, but be shown in another one or from the whole volume.
        """
        for state in self._annotations.classes:
            if state.close_up is not None and state.id in self._proxy.awaiting_close_ups:
                shown = self._shown.get(state.id)
                # If a point has enlarged the shown box, there is no other one to go back to.
                self._annotations.set_close_up(state.id, shown if shown != state.close_up else None)


def _change(before: _Place | None, now: _Place) -> np.ndarray | None:
    """The matrix (4, 4) by which a transform has moved a class's points; None if it has not."""
    if before is None or (before.to_world == now.to_world).all() or before.points.shape != now.points.shape:
        return None
    change = now.to_world @ np.linalg.inv(before.to_world)
    went_along = np.allclose(transform_points(change, before.points), now.points, rtol=0.0, atol=_SAME_MM)
    return change if went_along else None


def _moved(close_up: CloseUpBox, change: np.ndarray) -> CloseUpBox:
    x, y, z = transform_points(change, np.array(close_up[:3]))[0].tolist()
    return (x, y, z, *close_up[3:])
