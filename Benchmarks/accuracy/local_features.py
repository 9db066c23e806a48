"""The 11 local features of a voxel that Soundararajan & Schultz (2015) classify by.

As the paper lists them: the intensity, those of the neighbouring voxels (6, face to face), the gradient's magnitude and the
voxel's position (3).
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ViTTransferFunction.Logic.core.volumes.volume import Volume

COUNT = 11
_NEIGHBOURS = [(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)]
_SAMPLE_VOXELS = 100_000


class LocalFeatures:
    """Local features of one volume's voxels, each scaled to zero mean and unit variance over the volume.

    Args:
        volume: the intensities; all finite.
    """

    def __init__(self, volume: Volume) -> None:
        self._intensities = volume.array.astype(np.float32)
        self._spacing_mm = volume.geometry.spacing_mm[::-1].astype(np.float32)
        self._gradient = self._gradient_magnitude()
        everywhere = np.linspace(0, volume.array.size - 1, min(volume.array.size, _SAMPLE_VOXELS)).astype(np.int64)
        self._mean, self._scale = np.zeros(COUNT, dtype=np.float32), np.ones(COUNT, dtype=np.float32)
        sample = self.of(everywhere)
        self._mean, self._scale = sample.mean(axis=0), np.maximum(sample.std(axis=0), np.float32(1e-6))

    def of(self, voxels: np.ndarray) -> np.ndarray:
        """(N, 11) float32, of the voxels with these indices (N,) into the flattened volume."""
        shape = np.array(self._intensities.shape)
        kji = np.stack(np.unravel_index(voxels, self._intensities.shape), axis=1)
        features = np.empty((len(voxels), COUNT), dtype=np.float32)
        features[:, 0] = self._intensities.ravel()[voxels]
        for column, offset in enumerate(_NEIGHBOURS, start=1):
            # Beyond the volume it goes on as at its border.
            neighbour = np.clip(kji + offset, 0, shape - 1)
            features[:, column] = self._intensities[tuple(neighbour.T)]
        features[:, 7] = self._gradient.ravel()[voxels]
        features[:, 8:] = kji * self._spacing_mm
        features -= self._mean
        features /= self._scale
        return features

    def _gradient_magnitude(self) -> np.ndarray:
        squared = np.zeros_like(self._intensities)
        for axis, spacing_mm in enumerate(self._spacing_mm):
            squared += (ndimage.correlate1d(self._intensities, [-0.5, 0.0, 0.5], axis=axis, mode="nearest") / spacing_mm) ** 2
        return np.sqrt(squared, out=squared)
