"""Volumes of any size for measurements of time, for which only their shape and their share of air count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume

AIR_HU, TISSUE_HU, NOISE_HU = -1000, 40, 60


@dataclass(frozen=True)
class GeneratedVolume:
    """Noisy tissue, and air around it.

    Attributes:
        name: of the volume.
        shape: voxels along (K, J, I).
        spacing_mm: along (I, J, K).
        semi_axes: of the ellipse that the body fills in every slice, in units of half a slice's edges; None: no air.
    """

    name: str
    shape: tuple[int, int, int]
    spacing_mm: tuple[float, float, float]
    semi_axes: tuple[float, float] | None

    def volume(self) -> Volume:
        """The volume, int16; the same at each call."""
        random = np.random.default_rng(0)
        array = np.empty(self.shape, dtype=np.int16)
        body = self._body()
        for plane in array:
            plane[...] = np.where(body, TISSUE_HU + NOISE_HU * random.standard_normal(self.shape[1:], dtype=np.float32), AIR_HU)
        return Volume(array, Geometry(self.shape, np.diag([*self.spacing_mm, 1.0])), self.name)

    def _body(self) -> np.ndarray:
        if self.semi_axes is None:
            return np.ones(self.shape[1:], dtype=bool)
        y, x = (
            np.linspace(-1.0, 1.0, edge) / semi_axis for edge, semi_axis in zip(self.shape[1:], self.semi_axes, strict=True)
        )
        body: np.ndarray = y[:, None] ** 2 + x**2 < 1.0
        return body


GENERATED = (
    GeneratedVolume("CT of a body", (300, 512, 512), (0.8, 0.8, 2.0), (0.6, 0.85)),
    GeneratedVolume("crop without air", (128, 128, 128), (1.0, 1.0, 1.0), None),
)
