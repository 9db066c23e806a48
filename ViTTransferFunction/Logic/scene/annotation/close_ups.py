"""Structures that are small or thin in the whole volume, looked at by themselves where the user, or an outline, asks for it."""

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
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..interface.wording import close_up_text
from ..mrml.transforms import matrix_to_world
from ..volumes.opened_volume import OpenedVolume
from .annotations import SceneAnnotations
from .asked_maps import AskedMaps

_SAME_MM = 1e-3
"""Points that a transform has moved are rounded by less."""


@dataclass(frozen=True, eq=False)
class _Place:
    """Where the points of a class are: (N, 3) RAS millimetres, and (4, 4) the transforms that their list is under."""

    points: np.ndarray
    to_world: np.ndarray


class SceneCloseUps:
    """Gives classes the boxes in which they are looked at, and takes them away again: each time one step for undo.

    Args:
        parameters: say which volume.
        annotations: hold the classes, and so the boxes.
        volume: is being looked at.
        maps: that were asked for last.
        proxy: has the maps that boxes are chosen by, and gets what the boxes show.
        problems: are told why a class cannot be looked at by itself.
        notices: front ends hear of that.
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
        self._places: dict[tuple[str, str], _Place] = {}  # By the IDs of volume and class: what is chosen may change.

    def look_closer(self, id_: str) -> None:
        """Have a class looked at in a box around it as it is shown now, or tell the user why it cannot be.

        What is small or thin shows better there. The box's own features take a few seconds, in which the map of the whole
        volume stays. Once more, and the box fits what the structure looks like by then.
        """
        self._problems.solve("close-up")  # The same one again is told again.
        content, class_map, request = self._volume.content, self._proxy.maps.get(id_), self._maps.requests.of(id_)
        name = next(state.name for state in self._annotations.classes if state.id == id_)
        if content is None or class_map is None or request is None:
            self._problems.put("close-up", f"Place a point on {name} first, and wait until it is shown.")
        else:
            try:
                self.look_at(id_, close_up_of(class_map, request.positive, content.geometry))
            except InputError as error:
                self._problems.put("close-up", f"{name}: {error}")
        self._notices.tell()

    def look_at(self, id_: str, close_up: CloseUp) -> None:
        """Have a class looked at in a box, in the frame of the volume that is opened.

        Raises:
            InputError: the volume is under transforms that no matrix says.
        """
        self._problems.solve("close-up")
        # Where the box is the same as one that could not be looked at, nothing else would tell that it is wanted.
        self._proxy.try_close_ups_again()
        to_world = matrix_to_world(self._parameters.volume)
        centre = transform_points(to_world, np.array(close_up.centre_ras))[0].tolist()
        self._annotations.set_close_up(id_, (*centre, *close_up.size_mm))

    def look_at_whole(self, id_: str) -> None:
        """Have a class looked at in the whole volume again."""
        self._problems.solve("close-up")
        self._annotations.set_close_up(id_, None)

    def size_mm(self, state: ClassState) -> EdgesMm | None:
        """Of the box that a class is looked at in, with what points beyond have added to it; None: it is in the whole volume.

        Where the class has no point in the volume, or there is none, of the box as it was set.
        """
        content, request = self._volume.content, self._maps.requests.of(state.id)
        if content is None or request is None or request.close_up is None:
            return None if state.close_up is None else state.close_up[3:]
        return request.close_up.enlarged(content.geometry, request.positive).size_mm

    def failed(self, state: ClassState) -> bool:
        """Whether a class is shown as in the whole volume, because its box could not be looked at."""
        return state.close_up is not None and state.id in self._proxy.failed_close_ups

    def text(self, state: ClassState) -> str:
        """In what a class is looked at, in words; "": in the whole volume, as nobody asked for something else."""
        return close_up_text(self.size_mm(state), self.failed(state))

    def go_along(self) -> None:
        """Move boxes whose points a transform has moved since the last call about this volume, with the volume say.

        Not at once: a transform that is hardened moves points twice, there and back, and no box.
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
        """The scene is another one, in which nothing was moved."""
        self._places.clear()
        self._shown.clear()

    def _place(self, state: ClassState) -> _Place | None:
        """None where no matrix says the transforms."""
        try:
            to_world = matrix_to_world(self._annotations.points_node(state.id, positive=True))
        except InputError:
            return None
        return _Place(np.array(state.positive).reshape(-1, 3), to_world)

    def remember_shown(self) -> None:
        """Remember which box each class is shown in, of those whose maps are there as they were asked for."""
        awaited = self._proxy.awaiting_close_ups
        self._shown |= {state.id: state.close_up for state in self._annotations.classes if state.id not in awaited}

    def take_back(self) -> None:
        """Stop looking closer at the classes whose boxes are not there yet: they are in what they are shown in.

        Left as it is, a class would be said to be looked at in a box, and be shown as in another or in the whole.
        """
        for state in self._annotations.classes:
            if state.close_up is not None and state.id in self._proxy.awaiting_close_ups:
                shown = self._shown.get(state.id)
                # Where a point enlarged the box that it is shown in, there is none to go back to.
                self._annotations.set_close_up(state.id, shown if shown != state.close_up else None)


def _change(before: _Place | None, now: _Place) -> np.ndarray | None:
    """(4, 4): how a transform has moved a class's points; None where it has not."""
    if before is None or (before.to_world == now.to_world).all() or before.points.shape != now.points.shape:
        return None
    change = now.to_world @ np.linalg.inv(before.to_world)
    went_along = np.allclose(transform_points(change, before.points), now.points, rtol=0.0, atol=_SAME_MM)
    return change if went_along else None


def _moved(close_up: CloseUpBox, change: np.ndarray) -> CloseUpBox:
    x, y, z = transform_points(change, np.array(close_up[:3]))[0].tolist()
    return (x, y, z, *close_up[3:])
