"""The position and the intensity under the mouse in a slice view, as Slicer's Data Probe shows them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from vtkmodules.vtkCommonCore import vtkCommand

from ..Logic.core.system.errors import InputError
from ..Logic.core.volumes.measures import position_decimals
from ..Logic.core.volumes.patient_sides import position_text
from ..Logic.scene.mrml.transforms import world_to_local
from ..Logic.scene.tools.view_mouse import SliceMouse
from ..Logic.scene.volumes.volume_nodes import array_from_node, geometry_from_node


class DataProbe:
    """Follows the mouse in one slice view, and the slice below it.

    Args:
        interactor: of the view's render window.
        slice_node: says where the view lies in the patient.
        volume: the volume node that is shown, or None.
        show: gets the text, "R 98, A 164, S 394: 54" say, whenever it may be another one.
    """

    def __init__(self, interactor: Any, slice_node: Any, volume: Callable[[], Any], show: Callable[[str], None]) -> None:
        self._mouse = SliceMouse(interactor, slice_node)
        self._volume = volume
        self._show = show
        self._is_inside = False
        self._mouse.listen({vtkCommand.MouseMoveEvent: self._move, vtkCommand.LeaveEvent: self._leave})
        slice_node.AddObserver(vtkCommand.ModifiedEvent, self._on_slice)

    def tell_anew(self) -> None:
        """Another volume is shown, under a mouse that may rest."""
        if self._is_inside:
            self._tell()
        else:
            self._show("")

    def _move(self) -> bool:
        self._is_inside = True
        self._tell()
        return False

    def _leave(self) -> bool:
        self._is_inside = False
        return False

    def _on_slice(self, caller: Any, event: str) -> None:
        if self._is_inside:
            self._tell()

    def _tell(self) -> None:
        volume = self._volume()
        self._show(probe_text(volume, self._mouse.in_patient(self._mouse.position)) if volume is not None else "")


def probe_text(volume: Any, point_ras: np.ndarray) -> str:
    """A position of the scene, (3,) RAS millimetres, and how bright a volume node is there, where that can be said."""
    try:
        geometry, local_ras = geometry_from_node(volume), world_to_local(volume, point_ras[None])
    except InputError:
        return position_text(point_ras)
    position = position_text(point_ras, position_decimals(float(geometry.spacing_mm.min())))
    if not geometry.contains(local_ras).all():
        return position
    k, j, i = geometry.nearest_voxels(local_ras)[0]
    return f"{position}: {array_from_node(volume)[k, j, i]:g}"
