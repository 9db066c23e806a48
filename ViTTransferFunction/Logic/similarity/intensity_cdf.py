"""The empirical cumulative distribution function (CDF) of a volume's intensities: roughly, what share of its voxels is darker.

Values of the CDF do not depend on units and outliers, and tell apart best what is most frequent, in CT as in MR. It is not to
the letter what share is darker: a value that fills several of 512 quantiles by itself, such as the air of a CT or the padding
around a scan, counts as one. So it takes no more room than others; and where there are few different values, as in 8 bits, the
CDF grows about evenly with them.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..core.volumes.geometry import Geometry
from ..core.volumes.intensity_window import finite_sample, quantiles
from ..core.volumes.volume import Volume

ON_CENTRE = 1e-4
"""What is no farther from a voxel's centre along an axis, in voxels, is at it: headers are as exact as that."""
LONGEST_STEP_CELLS = 1 / 3
"""Samples of a mean are no farther apart than this share of a cell, or than voxels along their thinnest axis. Averaged over
three slices as thick as a cell, a nodule in a lung looked like lung."""
_LEVELS = 512
_NEIGHBOURS = np.array(list(np.ndindex(3, 3, 3)), dtype=np.float64) - 1.0


class IntensityCdf:
    """The CDF of one volume.

    Args:
        volume: the intensities; voxels that are not finite are passed over.
    """

    def __init__(self, volume: Volume) -> None:
        self._volume = volume
        self._levels = np.unique(quantiles(finite_sample(volume), np.linspace(0.0, 1.0, _LEVELS + 1)))

    def at(self, points_ras: np.ndarray) -> np.ndarray:
        """The CDF, in [0, 1], of interpolated intensities at world points (N, 3), (N,) float32; 0 where they are NaN."""
        return self._cdf(np.nan_to_num(self._sample(self._volume.geometry.ras_to_ijk(points_ras)), nan=-np.inf))

    def around(self, points_ras: np.ndarray, cells: Geometry) -> np.ndarray:
        """As `at`, of the mean over 3 × 3 × 3 samples, which keeps noise out.

        Args:
            points_ras: (N, 3) RAS millimetres.
            cells: a grid that fills the volume's box. Samples are a voxel apart, or less along axes along which voxels are much
                thicker than along the others and not small beside cells (`LONGEST_STEP_CELLS`).
        """
        ijk = self._volume.geometry.ras_to_ijk(points_ras)
        total, count = np.zeros(len(ijk)), np.zeros(len(ijk))
        for offset in _NEIGHBOURS * self._steps(cells):
            samples = self._sample(ijk + offset)
            finite = np.isfinite(samples)
            total[finite] += samples[finite]
            count += finite
        return self._cdf(np.where(count > 0.0, total / np.maximum(count, 1.0), -np.inf))

    def around_cells(self, cells: Geometry) -> np.ndarray:
        """As `around`, of the centres of all cells of a grid that fills the volume's box, in the order of a flattened array."""
        array = self._volume.array
        counts = zip(cells.shape, array.shape, self._steps(cells)[::-1], strict=True)
        (k, of_k), (j, of_j), (i, of_i) = (_four_weights(*along_axis) for along_axis in counts)
        means = np.empty(cells.shape)
        for layer in range(len(k)):
            # One layer of cells at a time, so that no copy of the volume is made; along I, where that is slow, picked out last.
            voxels = array[k[layer]][:, j.ravel()]
            if not np.isfinite(voxels).all():
                return self.around(cells.voxel_centres_ras(), cells)
            rows = np.tensordot(of_k[layer], voxels.astype(np.float64), 1).reshape(*j.shape, -1)
            columns = (of_j[:, :, None] * rows).sum(axis=1)
            means[layer] = (columns[:, i] * of_i).sum(axis=2)
        return self._cdf(means.ravel())

    def _steps(self, cells: Geometry) -> np.ndarray:
        """Distances between the samples of a mean, in voxels along I, J, K."""
        spacing = self._volume.geometry.spacing_mm
        longest_mm = np.maximum(LONGEST_STEP_CELLS * cells.spacing_mm, spacing.min())
        steps: np.ndarray = np.minimum(1.0, longest_mm / spacing)
        return steps

    def _sample(self, ijk: np.ndarray) -> np.ndarray:
        samples: np.ndarray = ndimage.map_coordinates(
            self._volume.array, ijk[:, ::-1].T, output=np.float64, order=1, mode="nearest", prefilter=False
        )
        missing = np.flatnonzero(~np.isfinite(samples))
        if len(missing):
            kji = np.clip(ijk[missing, ::-1], 0.0, np.array(self._volume.shape) - 1.0)
            centres = np.rint(kji)
            on_centres = np.abs(kji - centres) < ON_CENTRE
            # There, what counts for nothing but is not finite took the voxel's own value away, on one side of it alone.
            again = on_centres.any(axis=1)
            samples[missing[again]] = self._between_centres(np.where(on_centres, centres, kji)[again])
        return samples

    def _between_centres(self, kji: np.ndarray) -> np.ndarray:
        """Interpolated at places (N, 3) along K, J, I, between voxels on both sides or, along an axis, of the one there."""
        ends = np.stack([np.floor(kji), np.ceil(kji)]).astype(int)
        after = kji - ends[0]
        samples = np.zeros(len(kji))
        for k, j, i in np.ndindex(2, 2, 2):
            weights = np.where((k, j, i), after, 1.0 - after).prod(axis=1)
            values = self._volume.array[ends[k, :, 0], ends[j, :, 1], ends[i, :, 2]]
            with np.errstate(invalid="ignore"):  # Between infinities of either sign, nothing is a number.
                samples += weights * np.where(weights > 0.0, values, 0.0)
        return samples

    def _cdf(self, intensities: np.ndarray) -> np.ndarray:
        cdf: np.ndarray = np.interp(intensities, self._levels, np.linspace(0.0, 1.0, len(self._levels))).astype(np.float32)
        return cdf


def _four_weights(cells: int, voxels: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """The voxels along an axis that count for each of its cells, and how much, (cells, 4) each; weights sum to 1.

    Three samples, each interpolated between two voxels and at most one voxel apart, lie within four.
    """
    centres = (np.arange(cells)[:, None] + 0.5) * (voxels / cells) - 0.5
    near = np.floor(centres).astype(int) + np.arange(-1, 3)
    apart = np.abs((centres + step * np.arange(-1, 2))[:, :, None] - near[:, None])
    # Beyond the border its voxels go on.
    return np.clip(near, 0, voxels - 1), np.maximum(1.0 - apart, 0.0).mean(axis=1)
