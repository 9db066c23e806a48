"""What a voxel's own intensity says of its class: a likelihood ratio, learned from the map itself.

Features tell structures apart, but their cells are many voxels wide; intensities are as fine as the volume. Where a map
holds a structure mostly, its intensities there and around it are the two histograms p(u | inside) and p(u | outside), without
anybody having marked them (as in GrabCut: Rother, Kolmogorov, Blake, 2004). By Bayes' rule each voxel's odds are then
multiplied by their ratio, which is tempered and bounded, since a map is no perfect teacher and neighbouring voxels are no
independent witnesses:

    S'(x) = S(x) · (p(u_x | inside) / p(u_x | outside))^β.
"""

from __future__ import annotations

import numpy as np

from ..core.classes.class_map import NEAR_SHARE_OF_ISO
from ..core.system.progress import Between, nothing_between
from ..core.volumes.intensity_window import IntensityWindow
from .intensity_histograms import BINS, bins_of, density

TEMPER = 0.5
"""β."""
LARGEST_LOG_RATIO = 1.5
"""Bounds the ratio from either side: with β, a voxel's map changes by a factor of 2.1 at most."""
_BINS_SIGMA = 1.0
"""Standard deviation by which histograms are smoothed, in bins."""
_SMALLEST_SHARE = 0.08
"""Share of voxels spread over all bins, so that intensities hardly seen do not decide."""


def weigh_by_intensity(
    similarity: np.ndarray,
    intensities: np.ndarray,
    window: IntensityWindow,
    iso: float,
    near: float,
    between: Between = nothing_between,
) -> None:
    """Change each voxel's odds in a class's map by its intensity.

    Args:
        similarity: (K, J, I) float32 in [0, 1], at the volume's resolution; changed in place.
        intensities: (K, J, I), any real dtype; voxels that are not finite keep their map.
        window: in which the structure's edges show.
        iso: the map's threshold: even odds.
        near: where the map is below it, it stays as it is.
        between: called for each slice; may raise `Cancelled`.
    """
    inside, outside = np.zeros(BINS), np.zeros(BINS)
    # What is learned does not depend on how far it is applied: a larger size must not alter the map of a smaller one.
    learned_from = NEAR_SHARE_OF_ISO * iso
    # Slice by slice, so that nothing has the volume's size.
    for similarities, plane in zip(similarity, intensities, strict=True):
        between()
        voxels, bins = _near_voxels(similarities, plane, window, learned_from)
        probability = _probability_inside(similarities[voxels], iso)
        inside += np.bincount(bins, probability, BINS)
        outside += np.bincount(bins, 1.0 - probability, BINS)
    factors = np.exp(TEMPER * _log_ratio(inside, outside)).astype(np.float32)
    for similarities, plane in zip(similarity, intensities, strict=True):
        between()
        voxels, bins = _near_voxels(similarities, plane, window, near)
        similarities[voxels] = np.minimum(similarities[voxels] * factors[bins], 1.0)


def _probability_inside(similarities: np.ndarray, iso: float) -> np.ndarray:
    """What a map says of voxels before their intensities are looked at, (N,) float32 in [0, 1]: even odds at the iso value."""
    squared = similarities**2
    # An iso value of 0, which a user may fix, and values whose squares are 0 in single precision, are no even odds.
    inside: np.ndarray = squared / np.maximum(squared + np.float32(iso) ** 2, np.finfo(np.float32).tiny)
    return inside


def _near_voxels(
    similarities: np.ndarray, plane: np.ndarray, window: IntensityWindow, threshold: float
) -> tuple[np.ndarray, np.ndarray]:
    """Which voxels of a slice are near the structure, and the bins of their intensities, (near voxels,)."""
    near = (similarities > threshold) & np.isfinite(plane)
    return near, bins_of(plane[near], window)


def _log_ratio(inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """The logarithm log p(bin | inside) − log p(bin | outside), bounded, (bins,), from the histograms."""
    ratio = np.log(density(inside, _BINS_SIGMA, _SMALLEST_SHARE)) - np.log(density(outside, _BINS_SIGMA, _SMALLEST_SHARE))
    bounded: np.ndarray = np.clip(ratio, -LARGEST_LOG_RATIO, LARGEST_LOG_RATIO)
    return bounded
