"""The iso value of a map, chosen from the map and the image.

A prior says how far a class should reach that was clicked n times, half of n / (n + κ): few points raise a map only around
them. Near that prior, the iso value of a coarse map is drawn to where the mean edge strength along the iso-surface is largest:
the surface should run where the intensities have edges. A refined map has been sharpened at these edges; its iso value is the
most stable one, where the enclosed volume changes least (maximally stable extremal regions: Matas et al., 2002).
"""

from __future__ import annotations

import numpy as np

from .intensity_rank import IntensityRank

POINTS_TO_HALF = 1.5
"""κ of coarse maps."""
POINTS_TO_HALF_REFINED = 2.0
"""κ of refined maps."""
PRIOR_WEIGHT = 0.5
"""What a factor of e between iso value and prior costs, in units of the volume's mean edge strength."""
SOFTNESS = 0.3
"""Candidates are averaged by their gain, not the best one taken: the iso value must not jump from click to click."""
SURFACE_WIDTH = 0.25
"""Standard deviation, in the logarithm of the map, of what counts as near an iso-surface of a coarse map."""
STABILITY_WIDTH = 0.1
"""The same of a refined map."""
STABILITY_SOFTNESS = 0.05
"""As `SOFTNESS`, for gains that are logarithms."""
STABILITY_FLOOR = 0.02
"""Volumes that change by less than this share, per unit of the map's logarithm, count as equally stable."""
STABILITY_SAMPLES = 2_000_000
"""A refined map is looked at in so many voxels at most, spread evenly."""
LOWEST_LEVEL = 0.01
LARGEST_SHARE_OF_POSITIVES = 0.8
CANDIDATES = np.exp(np.linspace(np.log(0.02), np.log(0.7), 40))
_BINS = 200
_LEVELS = np.exp(np.linspace(np.log(LOWEST_LEVEL), 0.0, _BINS))


def prior_iso(positive_count: int, points_to_half: float = POINTS_TO_HALF) -> float:
    """The iso value of a class with so many different positive points, before the image is looked at."""
    return 0.5 * positive_count / (positive_count + points_to_half)


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
    highest = _highest(at_positives)
    seen = similarity > LOWEST_LEVEL
    if not seen.any():
        return min(prior, highest)
    # A histogram over log levels: the edge strength at every level costs one pass over the map.
    bins = _bins(similarity[seen])
    total_strength = np.bincount(bins, edge_strength[seen], _BINS)
    near = _near(SURFACE_WIDTH)
    strength = (near @ total_strength) / (near @ np.bincount(bins, minlength=_BINS) + 1e-9)
    gain = strength - PRIOR_WEIGHT * np.log(CANDIDATES / prior) ** 2
    return min(_softly_best(gain, SOFTNESS), highest)


def choose_stable_iso(similarity: np.ndarray, at_positives: np.ndarray, prior: float) -> float:
    """The iso value at which the volume that it encloses changes least, not far from the prior.

    It stays below the map's value at most positive points, so that what was clicked is selected.

    Args:
        similarity: a refined map of any shape, in [0, 1].
        at_positives: (P,) values of the map at the class's positive points, P ≥ 1.
        prior: from `prior_iso`.

    Returns:
        A value in (0, 1).
    """
    highest = _highest(at_positives)
    # An odd stride, so that it does not keep step with the rows.
    values = similarity.ravel()[:: similarity.size // STABILITY_SAMPLES | 1]
    values = values[values > LOWEST_LEVEL]
    if not values.size:
        return min(prior, highest)
    count = np.bincount(_bins(values), minlength=_BINS)
    enclosed = np.interp(np.log(CANDIDATES), np.log(_LEVELS), count[::-1].cumsum()[::-1])
    near = _near(STABILITY_WIDTH)
    per_unit = (near @ count) / near.sum(axis=1) * (_BINS - 1) / -np.log(LOWEST_LEVEL)
    gain = -np.log(per_unit / (enclosed + 1e-9) + STABILITY_FLOOR) - np.log(CANDIDATES / prior) ** 2
    return min(_softly_best(gain, STABILITY_SOFTNESS), highest)


def _highest(at_positives: np.ndarray) -> float:
    return max(LARGEST_SHARE_OF_POSITIVES * float(np.median(at_positives)), LOWEST_LEVEL)


def _bins(similarity: np.ndarray) -> np.ndarray:
    """The logarithmic level, an index to `_LEVELS`, of values above `LOWEST_LEVEL`."""
    depth = -np.log(LOWEST_LEVEL)
    return np.clip((np.log(similarity) + depth) / depth * (_BINS - 1), 0, _BINS - 1).astype(int)


def _near(width: float) -> np.ndarray:
    """How much each level counts for the surface at each candidate, (candidates, levels)."""
    return np.exp(-0.5 * ((np.log(_LEVELS) - np.log(CANDIDATES)[:, None]) / width) ** 2)


def _softly_best(gain: np.ndarray, softness: float) -> float:
    weights = np.exp((gain - gain.max()) / softness)
    return float(np.exp((weights * np.log(CANDIDATES)).sum() / weights.sum()))


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
