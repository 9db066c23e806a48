"""A client in the place of the one that talks to the compute process, and what it is asked about in tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ViTTransferFunction.Logic.compute.requests import TakeVolume
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.session.feature_estimate import FeatureEstimate
from ViTTransferFunction.Logic.session.settings import SessionSettings

GEOMETRY = Geometry((2, 2, 2), np.eye(4))
VOLUME = TakeVolume(np.zeros((2, 2, 2)), GEOMETRY, "CT")
SETTINGS = SessionSettings(grid=16)
COSTLY = FeatureEstimate(cached=False, seconds=5.0, memory_bytes=10**9)
LIVER, SPLEEN = (ClassRequest(id_, np.zeros((1, 3))) for id_ in ("liver", "spleen"))
CLOSER = replace(LIVER, close_up=CloseUp((0.0,) * 3, (1.0,) * 3))
MAP = ClassMap(np.zeros((2, 2, 2), dtype=np.float32), GEOMETRY, 0.4)
RENDERING = StructureVolume(np.zeros((2, 2, 2, 4), dtype=np.uint8), np.zeros((1, 2)), np.arange(256.0), False, 1.0, GEOMETRY)
MOVED = replace(LIVER, positive=np.ones((1, 3)))


class StubClient:
    """In the place of `ComputeClient`: keeps what is asked, and answers by `answer`."""

    pid = 1

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.cancelled: list[int] = []
        self.alive = True
        self._replies: list[tuple[int, Any]] = []

    def request(self, request: Any) -> int:
        self.asked.append(request)
        return len(self.asked)

    def cancel(self, numbers: Any) -> None:
        self.cancelled += numbers

    def answer(self, kind: type, reply: Any) -> None:
        """Reply to the last request of a kind."""
        number = max(number for number, request in enumerate(self.asked, start=1) if isinstance(request, kind))
        self._replies.append((number, reply))

    def replies(self) -> list[tuple[int, Any]]:
        replies, self._replies = self._replies, []
        return replies

    def last_words(self) -> str:
        return "MemoryError"

    def close(self) -> None:
        self.alive = False

    def kinds(self) -> list[str]:
        return [type(request).__name__ for request in self.asked]
