"""The volume that the compute process has: handed over when another one is chosen, and when it has got other voxels."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from ...compute.proxy import SegmentationProxy
from ...compute.requests import TakeVolume
from ...core.system.errors import InputError
from ...core.volumes.geometry import body_scale
from ...session.settings import SessionSettings
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems
from ..mrml.transforms import matrix_to_world, world_to_local
from .former_model import FormerModel
from .volume_content import VolumeContent, content_of, is_playing
from .volume_nodes import array_from_node
from .volume_window import replace_impossible_window

REST_S = 0.5
"""How long a volume must have kept its voxels before they are taken up: somebody may be leafing through a sequence."""


class OpenedVolume:
    """Keeps the compute process at the volume of the parameters.

    Args:
        parameters: say which volume, and with which settings.
        proxy: of the compute process.
        problems: are told where a volume or a setting cannot be used.
        former_model: of the scene.

    Attributes:
        content: what the process has; None for nothing.
    """

    def __init__(
        self, parameters: SceneParameters, proxy: SegmentationProxy, problems: Problems, former_model: FormerModel
    ) -> None:
        self._parameters = parameters
        self._former_model = former_model
        self._proxy = proxy
        self._problems = problems
        self._opened: tuple[Any, ...] | None = None
        self._changed_s: float | None = None
        self.content: VolumeContent | None = None

    @property
    def changed(self) -> bool:
        """Whether the volume has got other voxels, which are taken up when it rests and nothing runs for those before."""
        return self._changed_s is not None

    def contains(self, points_ras: np.ndarray) -> np.ndarray:
        """(N,) bool: which of some points of the scene (N, 3) lie in the volume; all of them where there is none."""
        node = self._parameters.volume
        if node is None or self.content is None:
            return np.ones(len(points_ras), dtype=bool)
        return self.content.geometry.contains(world_to_local(node, points_ras))

    @property
    def body_scale(self) -> float:
        """Of lengths in the scene that are meant for bodies, in the volume as it lies there; 1 where there is none."""
        if self.content is None:
            return 1.0
        return body_scale(float(self.content.geometry.extent_mm.max() * np.cbrt(self.enlargement or 1.0)))

    @property
    def enlargement(self) -> float | None:
        """How many times as large the volume is in the scene as in its local frame; None where no matrix says.

        A registration may scale it, and what Slicer measures in the scene, as by Segment Statistics, follows that.
        """
        node = self._parameters.volume
        try:
            return None if node is None else float(abs(np.linalg.det(matrix_to_world(node)[:3, :3])))
        except InputError:
            return None

    def open(self) -> bool:
        """Hand the volume over if it or what decides its features has changed; returns whether it has."""
        node, content, settings = self._parameters.volume, None, SessionSettings()
        try:
            settings = self._former_model.applied_to(self._parameters.session_settings())
            if node:
                replace_impossible_window(node)
                content = content_of(node)
            self._problems.solve("volume")
        except InputError as error:
            self._problems.put("volume", str(error))
        opened = (node.GetID() if content else None, settings)
        if opened == self._opened:
            if content is not None and self.content is not None:
                self._changed_s = None if content.state == self.content.state else time.monotonic()
            return False
        self._opened, self.content, self._changed_s = opened, content, None
        self._problems.solve("computing")
        volume = TakeVolume(array_from_node(node), content.geometry, node.GetName()) if content else None
        self._proxy.open(volume, settings)
        return True

    def open_again(self) -> bool:
        """Hand it over also if nothing has changed."""
        self._opened = None
        return self.open()

    def has_rested(self) -> bool:
        """Whether it is time for `open_again`: other voxels have come to rest."""
        node = self._parameters.volume
        if self._changed_s is None or node is None:
            return False
        if is_playing(node):
            self._changed_s = time.monotonic()
        return time.monotonic() >= self._changed_s + REST_S
