"""Structures that are small or thin in the whole volume, looked at by themselves where the user asks for it."""

from __future__ import annotations

import numpy as np

from ..compute.proxy import SegmentationProxy
from ..core.close_up_choice import close_up_of
from ..core.errors import InputError
from ..core.geometry import transform_points
from .annotations import SceneAnnotations
from .class_requests import ClassRequests
from .classes import ClassState, CloseUpBox, EdgesMm
from .opened_volume import OpenedVolume
from .parameters import SceneParameters
from .problems import Problems
from .volume import matrix_to_world


class SceneCloseUps:
    """Gives classes the boxes in which they are looked at, and takes them away again: each time one step for undo.

    Args:
        parameters: say which volume.
        annotations: hold the classes, and so the boxes.
        volume: is being looked at.
        proxy: has the maps that boxes are chosen by, and gets what the boxes show.
        problems: are told why a class cannot be looked at by itself.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        annotations: SceneAnnotations,
        volume: OpenedVolume,
        proxy: SegmentationProxy,
        problems: Problems,
    ) -> None:
        self._parameters = parameters
        self._annotations = annotations
        self._volume = volume
        self._proxy = proxy
        self._problems = problems
        self._shown: dict[str, CloseUpBox | None] = {}

    def look_closer(self, id_: str, requests: ClassRequests) -> None:
        """Have a class looked at in a box around it as it is shown now.

        What is small or thin shows better there. The box's own features take a few seconds, in which the map of the whole
        volume stays. Once more, and the box fits what the structure looks like by then.

        Args:
            id_: of the class.
            requests: what is asked for of the classes as they are.
        """
        self._problems.solve("close-up")
        volume, content, class_map = self._parameters.volume, self._volume.content, self._proxy.maps.get(id_)
        state = next(state for state in self._annotations.classes if state.id == id_)
        request = requests.of(id_)
        if volume is None or content is None or class_map is None or request is None:
            self._problems.put("close-up", f"Place a point on {state.name} first, and wait until it is shown.")
            return
        try:
            close_up = close_up_of(class_map, request.positive, content.geometry)
            centre = transform_points(matrix_to_world(volume), np.array(close_up.centre_ras))[0].tolist()
        except InputError as error:
            self._problems.put("close-up", f"{state.name}: {error}")
            return
        self._annotations.set_close_up(id_, (*centre, *close_up.size_mm))

    def look_at_whole(self, id_: str) -> None:
        """Have a class looked at in the whole volume again."""
        self._problems.solve("close-up")
        self._annotations.set_close_up(id_, None)

    def size_mm(self, state: ClassState, requests: ClassRequests) -> EdgesMm | None:
        """Of the box that a class is looked at in, with what points beyond have added to it; None: it is in the whole volume.

        Where the class has no point in the volume, or there is none, of the box as it was set.
        """
        content, request = self._volume.content, requests.of(state.id)
        if content is None or request is None or request.close_up is None:
            return None if state.close_up is None else state.close_up[3:]
        return request.close_up.enlarged(content.geometry, request.positive).size_mm

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
