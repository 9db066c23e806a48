"""The iso value of a map, chosen from the image: the surface should run where the intensities have edges.

A prior says how far a class should reach that was clicked n times, half of n / (n + κ): few points raise a map only around
them. Around that prior, the iso value is drawn to where the mean edge strength along the iso-surface is largest.
"""

from __future__ import annotations

import numpy as np

from .intensity_rank import IntensityRank

POINTS_TO_HALF = 1.5
"""κ."""
PRIOR_WEIGHT = 0.5
"""What a factor of e between iso value and prior costs, in units of the volume's mean edge strength."""
SOFTNESS = 0.3
"""Candidates are averaged by their gain, not the best one taken: the iso value must not jump from click to click."""
SURFACE_WIDTH = 0.25
"""Standard deviation, in the logarithm of the map, of what counts as near an iso-surface."""
LOWEST_LEVEL = 0.01
LARGEST_SHARE_OF_POSITIVES = 0.8
CANDIDATES = np.exp(np.linspace(np.log(0.02), np.log(0.7), 40))
_BINS = 200


def prior_iso(positive_count: int) -> float:
    """The iso value of a class with so many different positive points, before the image is looked at."""
    return 0.5 * positive_count / (positive_count + POINTS_TO_HALF)


def choose_iso_by_edges(similarity: np.ndarray, edge_strength: np.ndarray, at_positives: np.ndarray, prior: float) -> float:
    """The iso value whose surface runs along the strongest edges, not far from the prior.

    It stays below the map's value at most positive points, so that what was clicked is selected.

    Args:
        similarity: (N,) values of the map in [0, 1] at places spread evenly over the volume.
        edge_strength: (N,) edge strength at the same places; see `edge_strength_at`.
        at_positives: (P,) values of the map at the class's positive points, P ≥ 1.
        prior: from `prior_iso`.

    Returns:
        A value in (0, 1).
    """
    highest = max(LARGEST_SHARE_OF_POSITIVES * float(np.median(at_positives)), LOWEST_LEVEL)
    seen = similarity > LOWEST_LEVEL
    if not seen.any():
        return min(prior, highest)
    # A histogram over log levels: the edge strength at every level costs one pass over the map.
    depth = -np.log(LOWEST_LEVEL)
    bins = np.clip((np.log(similarity[seen]) + depth) / depth * (_BINS - 1), 0, _BINS - 1).astype(int)
    total_strength = np.bincount(bins, edge_strength[seen], _BINS)
    count = np.bincount(bins, minlength=_BINS)
    levels = np.arange(_BINS) / (_BINS - 1) * depth - depth
    near = np.exp(-0.5 * ((levels - np.log(CANDIDATES)[:, None]) / SURFACE_WIDTH) ** 2)
    strength = (near @ total_strength) / (near @ count + 1e-9)
    gain = strength - PRIOR_WEIGHT * np.log(CANDIDATES / prior) ** 2
    weights = np.exp((gain - gain.max()) / SOFTNESS)
    by_edges = float(np.exp((weights * np.log(CANDIDATES)).sum() / weights.sum()))
    return min(by_edges, highest)


def edge_strength_at(rank: IntensityRank, points_ras: np.ndarray, steps_ras: np.ndarray) -> np.ndarray:
    """Gradient magnitude of the intensity ranks, over its mean, (N,) float32.

    Args:
        rank: of the volume.
        points_ras: (N, 3) RAS millimetres.
        steps_ras: (3, 3), one in each row: steps along the volume's own axes over which differences are taken, to either side.
            Along the patient's, a volume that lies askew would have other edges than its upright twin.
    """
    squared = np.zeros(len(points_ras), dtype=np.float32)
    for step in steps_ras:
        squared += (rank.at(points_ras + step) - rank.at(points_ras - step)) ** 2
    strength = np.sqrt(squared)
    return strength / max(float(strength.mean()), 1e-12)
