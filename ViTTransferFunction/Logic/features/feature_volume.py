"""The feature volume F: one feature vector for each patch of a coarse grid that fills the volume's box."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.volumes.geometry import Geometry


@dataclass(frozen=True, eq=False)
class Moments:
    """How feature vectors are spread, over patches all through the volume.

    Attributes:
        mean: (C,) float64.
        covariance: (C, C) float64.
    """

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class FeatureVolume:
    """Features on the grid of the network's patches, and where these lie.

    Attributes:
        array: (K', J', I', C), float16 or float32; axis order as in volumes, channels last.
        geometry: the patches' grid; their borders coincide with voxel borders at the faces of the volume's box.
        key: names the content: equal for features of the same voxels, model and settings, and for no others (`feature_key`).
        compared_on: the cells that features are interpolated to where they are compared, of the same box; None: the patches.
        moments: of the vectors; None where nobody has asked for them yet.
    """

    array: np.ndarray
    geometry: Geometry
    key: str
    compared_on: Geometry | None = None
    moments: Moments | None = None

    def __post_init__(self) -> None:
        if self.array.ndim != 4 or self.array.shape[:3] != self.geometry.shape:
            raise ValueError(f"features of shape {self.array.shape} do not fit a grid of shape {self.geometry.shape}")
        if not np.allclose(self.geometry.resized(self.cells.shape).ijk_to_ras, self.cells.ijk_to_ras):
            raise ValueError(f"patches of shape {self.geometry.shape} and the cells do not fill the same box")

    @property
    def cells(self) -> Geometry:
        """The grid that features are compared on."""
        return self.compared_on or self.geometry

    @property
    def channels(self) -> int:
        """Feature dimension C."""
        return int(self.array.shape[3])

    def placed_in(self, geometry: Geometry) -> FeatureVolume:
        """The same features in the box of a grid: where the volume is that had another place when they were computed."""
        patches, cells = geometry.resized(self.geometry.shape), geometry.resized(self.cells.shape)
        return replace(self, geometry=patches, compared_on=cells)

    def vectors_at(self, kji: np.ndarray) -> np.ndarray:
        """The features (N, C) of patches (N, 3), along K', J', I'."""
        vectors: np.ndarray = self.array[tuple(kji.T)]
        return vectors
