"""The feature volume F: one feature vector for each cell of a coarse grid that fills the volume's box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.geometry import Geometry


@dataclass(frozen=True, eq=False)
class FeatureVolume:
    """Features on a grid of cells, and where the cells lie.

    Attributes:
        array: (K', J', I', C), float16 or float32; axis order as in volumes, channels last.
        geometry: the cells' grid; cell borders coincide with voxel borders at the faces of the volume's box.
        key: names the content: equal for features of the same volume, model and settings, and for no others.
    """

    array: np.ndarray
    geometry: Geometry
    key: str

    def __post_init__(self) -> None:
        if self.array.ndim != 4 or self.array.shape[:3] != self.geometry.shape:
            raise ValueError(f"features of shape {self.array.shape} do not fit a grid of shape {self.geometry.shape}")

    @property
    def channels(self) -> int:
        """Feature dimension C."""
        return int(self.array.shape[3])

    def vectors_at(self, kji: np.ndarray) -> np.ndarray:
        """The features (N, C) of cells (N, 3), along K', J', I'."""
        vectors: np.ndarray = self.array[tuple(kji.T)]
        return vectors

    def whole(self) -> FeatureVolume:
        """These features, all in memory: themselves."""
        return self
