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


def sample_at(values: np.ndarray, geometry: Geometry, points_ras: np.ndarray) -> np.ndarray:
    """Trilinear samples of a grid of vectors at world points, constant beyond the outermost cell centres.

    Args:
        values: (K', J', I', C).
        geometry: of the cells.
        points_ras: (N, 3) RAS millimetres.

    Returns:
        (N, C) float32.
    """
    kji = geometry.ras_to_ijk(points_ras)[:, ::-1]
    last = np.array(geometry.shape) - 1
    kji = np.clip(kji, 0, last)
    base = np.minimum(np.floor(kji).astype(int), np.maximum(last - 1, 0))
    fraction = kji - base
    samples = np.zeros((len(kji), values.shape[3]), dtype=np.float64)
    for corner in np.ndindex(2, 2, 2):
        index = np.minimum(base + corner, last)
        weight = np.prod(np.where(corner, fraction, 1.0 - fraction), axis=1)
        samples += weight[:, None] * values[tuple(index.T)]
    return samples.astype(np.float32)
