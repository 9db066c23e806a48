"""How often intensities occur within a structure and around it, from which each voxel's own says on which side it is."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..core.volumes.intensity_window import IntensityWindow

BINS = 64


def bins_of(intensities: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """The bin of each intensity, from 0 to `BINS` − 1, uint8 of their shape."""
    bins: np.ndarray = np.minimum(window.apply(intensities) * BINS, BINS - 1).astype(np.uint8)
    return bins


def density(histogram: np.ndarray, sigma: float, smallest_share: float) -> np.ndarray:
    """A histogram (bins,) as probabilities, smoothed.

    Args:
        histogram: counts or weights.
        sigma: standard deviation of the smoothing, in bins.
        smallest_share: of the voxels, spread over all bins, so that intensities hardly seen do not decide.
    """
    smooth = ndimage.gaussian_filter1d(histogram, sigma)
    found: np.ndarray = (smooth / max(float(smooth.sum()), 1e-9) + smallest_share / len(histogram)) / (1.0 + smallest_share)
    return found
