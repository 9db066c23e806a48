"""Thresholding around the clicked intensities, then the components that were clicked: what every viewer can do."""

from __future__ import annotations

import numpy as np

from Benchmarks.accuracy.seeds import Seeds
from ViTTransferFunction.Logic.core.volumes.volume import Volume

WIDTH = 2.0
"""Half of a class's range of intensities, in standard deviations."""
_CUBE = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


class ClickedThreshold:
    """Thresholds one volume: each class takes mean ± 2 standard deviations of the 3 × 3 × 3 voxels around its clicks.

    Args:
        volume: the intensities.
    """

    def __init__(self, volume: Volume) -> None:
        self._intensities = volume.array.astype(np.float32)

    def __call__(self, seeds: Seeds) -> np.ndarray:
        """Labels (K, J, I) uint16; where ranges overlap, the class whose mean is nearer in its standard deviations."""
        labels = np.zeros(self._intensities.shape, dtype=np.uint16)
        nearest = np.full(labels.shape, WIDTH, dtype=np.float32)
        for label in range(1, int(seeds.labels.max()) + 1):
            around = (seeds.of_class(label)[:, None] + _CUBE).reshape(-1, 3)
            values = self._intensities[tuple(np.clip(around, 0, np.array(labels.shape) - 1).T)]
            deviations = np.abs(self._intensities - values.mean()) / max(float(values.std()), 1e-6)
            wins = deviations < nearest
            labels[wins] = label
            nearest[wins] = deviations[wins]
        return labels
