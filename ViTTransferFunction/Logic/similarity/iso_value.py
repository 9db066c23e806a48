"""The iso value of a map, chosen from the map and the image.

A prior follows from the number n of a class's positive points, half of n / (n + κ): few points raise a map only around them.
Negative points raise the prior where they lie well within what is too much. From the prior, the iso value is drawn to where
the mean edge strength along the iso-surface is largest: the surface should run where the intensities have edges; and, the
fewer the points, the more to where it encloses what a stable component around them does (`stable_components`). A refined map
has been sharpened at these edges, so that its iso value is drawn as well to where the enclosed volume changes least (maximally
stable extremal regions: Matas et al., 2002).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..core.classes.iso_proposals import LARGER, LARGEST_ISO, SMALLER, SMALLEST_ISO, IsoProposals
from ..core.system.progress import Between, nothing_between
from .intensity_cdf import IntensityCdf
from .stable_components import TOLERANCES, component_sizes, stability

POINTS_TO_HALF = 1.5
"""κ."""
MOST_POINTS = 6
"""More points than these do not raise the prior: they are a brush's, or many parts', and maps do not rise as far."""
ABOVE_NEGATIVES = 2.0
"""The structure is taken to end where the map is this many times its lowest value around a negative point."""
PRIOR_WEIGHT = 0.5
"""What a factor of e between iso value and prior costs, in units of the volume's mean edge strength."""
SOFTNESS = 0.3
"""Candidates are averaged by their gain, not the best one taken: the iso value must not jump from click to click."""
SURFACE_WIDTH = 0.25
"""Standard deviation, in the logarithm of the map, of what counts as near an iso-surface of a coarse map."""
STABILITY_WIDTH = 0.1
"""The same of a refined map, whose levels lie closer at edges."""
REFINED_EDGE_WEIGHT = 0.5
REFINED_SOFTNESS = 0.1
"""Of refined maps, whose gain is a logarithm of how much the volume changes: the weight of edge strength, and the softness."""
STABILITY_FLOOR = 0.02
"""Volumes that change by less than this share, per unit of the map's logarithm, count as equally stable."""
STABILITY_SAMPLES = 1_000_000
"""No more voxels of what is held of a refined map are looked at, spread evenly: more would only take longer."""
VALUES_AT_ONCE = 2**17
"""So many are counted between two calls of `between`: a click does not have to wait for the others."""
LOWEST_LEVEL = 0.01
"""Lower values of a map are not told apart, and no iso value is lower."""
LEAST_AGREEMENT = 0.3
"""A map and a component that agree no better tell nothing."""
COMPONENT_WEIGHT, REFINED_COMPONENT_WEIGHT = 8.0, 12.0
"""What full agreement counts beside the edges of a coarse map, and beside the stability of a refined one."""
LARGEST_LOWERING = 0.3
"""Share of a map at its points that refinement leaves: if it leaves less, the prior follows only down to here."""
SMALLER_SHARE_OF_POSITIVES = 0.95
"""Of the value that most points reach, the most that the smaller structure's iso value may be: it is to hold these points."""
LEAST_STEP = 1.05
"""Least ratio between the iso values of the smaller structure and the chosen one: a step must do something."""
LARGEST_SHARE_OF_POSITIVES = 0.5
"""Of the value that most points reach, the most that the iso value may be. Where a map is low even at its points, such as that
of a kidney clicked once in its middle and often outside, little but the point was left above a higher one."""
CANDIDATES = np.exp(np.linspace(np.log(0.02), np.log(0.7), 40))
"""Iso values that are compared, at even steps of their logarithm."""
_BINS = 200
_LEVELS = np.exp(np.linspace(np.log(LOWEST_LEVEL), 0.0, _BINS))


def prior_iso(positive_count: int) -> float:
    """The iso value of a class with this many different positive points, before the image is looked at."""
    count = min(positive_count, MOST_POINTS)
    return 0.5 * count / (count + POINTS_TO_HALF)


def raised_prior(prior: float, around_negatives: np.ndarray, positive_count: int) -> float:
    """The prior of a class some of whose points are negative.

    A click on what is too much says that the structure ends earlier, which the number of positive points does not tell. How
    much earlier is read from the map as it would be without any negative points: its lowest value s around a negative point is
    high where the surplus is wide, and low where it is a rim, which the point itself takes away. With m negative points and n
    positive ones:

        prior · min(exp(Σ max(ln(2 s / prior), 0) / max(m, n)), 1 + m / n).

    Args:
        prior: from `prior_iso`.
        around_negatives: (m,) the lowest values s around the negative points, in [0, 1].
        positive_count: n, at least one.
    """
    count = len(around_negatives)
    above = np.log(np.maximum(ABOVE_NEGATIVES * around_negatives / prior, 1.0)).sum()
    return prior * min(float(np.exp(above / max(count, positive_count))), 1.0 + count / positive_count)


def refined_prior(prior: float, coarse_at_positives: np.ndarray, at_positives: np.ndarray) -> float:
    """The prior of a refined map: half as far below that of S_L, on a logarithmic scale, as the map is at the points.

    Refinement averages the map over voxels that look alike. Where most of a structure is far below its points in S_L, this
    lowers the map at the points: it shows the values of the whole structure, which the number of points does not tell.

    Args:
        prior: of S_L.
        coarse_at_positives: (P, …) values of S_L at the class's positive points, P ≥ 1.
        at_positives: (P,) values of S_H there.
    """
    lowered = float(np.median(at_positives)) / max(float(np.median(coarse_at_positives)), SMALLEST_ISO)
    return prior * float(np.sqrt(np.clip(lowered, LARGEST_LOWERING, 1.0)))


class Levels:
    """Values of a map at cells, sorted into logarithmic levels once for all that is asked of them.

    Args:
        similarity: (N,) values in [0, 1].

    Attributes:
        seen: indices of those above `LOWEST_LEVEL`.
        bins: the levels of these, 0 to `_BINS` − 1.
    """

    def __init__(self, similarity: np.ndarray) -> None:
        self.seen = np.flatnonzero(similarity > LOWEST_LEVEL)
        self.bins = _bins(similarity[self.seen])


@dataclass(frozen=True, eq=False)
class Components:
    """What lies around a class's points.

    Attributes:
        steps: (N,) uint8, components at the cells of a map (`StableComponents.of_class`).
        positive_count: how many different positive points the class has.
    """

    steps: np.ndarray
    positive_count: int


def component_evidence(levels: Levels, components: Components) -> np.ndarray:
    """How well what each candidate encloses agrees with a stable component of the class, (candidates,), from 0 up.

    For the best component, it is the Dice of the two times the component's stability, as far as that exceeds `LEAST_AGREEMENT`,
    over the square root of the number of positive points: the more there are, the more they tell themselves.

    Args:
        levels: of the map, at cells spread evenly over the volume.
        components: at the same cells.
    """
    steps, tolerances = components.steps, len(TOLERANCES)
    sizes = component_sizes(steps)
    joint = np.bincount(levels.bins * (tolerances + 1) + steps[levels.seen], minlength=_BINS * (tolerances + 1))
    # How many cells each level encloses, of all and of each component.
    enclosed = joint.reshape(_BINS, tolerances + 1)[::-1].cumsum(axis=0)[::-1].cumsum(axis=1)
    overlap = 2.0 * enclosed[:, :-1] / (enclosed[:, -1:] + sizes + 1e-9)
    agreement = (overlap * stability(sizes, len(steps))).max(axis=1)
    evidence: np.ndarray = np.interp(np.log(CANDIDATES), np.log(_LEVELS), np.maximum(agreement - LEAST_AGREEMENT, 0.0))
    evidence /= np.sqrt(components.positive_count)
    return evidence


def choose_iso_by_edges(
    similarity: np.ndarray,
    edge_strength: np.ndarray,
    at_positives: np.ndarray,
    prior: float,
    components: Components | None = None,
) -> float:
    """The iso value whose surface runs along the strongest edges, not far from the prior.

    It stays below the map's value at most positive points, so that what was clicked is selected.

    Args:
        similarity: (N,) values of the map in [0, 1] at places spread evenly over the volume.
        edge_strength: (N,) edge strength at the same places; see `edge_strength_at`.
        at_positives: (P,) values of the map at the class's positive points, P ≥ 1.
        prior: from `prior_iso`, maybe raised.
        components: around the class's points, at the same places; None: they are not looked at.

    Returns:
        A value in (0, 1).
    """
    levels = Levels(similarity)
    gain = _strength_along_surfaces(levels, edge_strength) - PRIOR_WEIGHT * np.log(CANDIDATES / prior) ** 2
    if components is not None:
        gain += COMPONENT_WEIGHT * component_evidence(levels, components)
    return _near_prior(gain, SOFTNESS, at_positives)


def choose_refined_iso(
    voxels: Iterable[tuple[np.ndarray, float]],
    similarity: np.ndarray,
    edge_strength: np.ndarray,
    at_positives: np.ndarray,
    prior: float,
    components: Components | None = None,
    between: Between = nothing_between,
) -> float:
    """The iso value of a refined map: along strong edges, where the volume that it encloses changes little.

    Args:
        voxels: values of the map in [0, 1], of any shape, and how many voxels each stands for (`VoxelMap.spread`);
            `STABILITY_SAMPLES` are enough.
        similarity: as for `choose_iso_by_edges`, of the refined map.
        edge_strength: at the same places.
        at_positives: (P,) values of the refined map at the class's positive points, P ≥ 1.
        prior: from `refined_prior`.
        components: as for `choose_iso_by_edges`.
        between: called between short steps; may raise `Cancelled`.

    Returns:
        A value in (0, 1).
    """
    levels = Levels(similarity)
    edges = REFINED_EDGE_WEIGHT * _strength_along_surfaces(levels, edge_strength)
    gain = edges - _log_instability(voxels, between) - np.log(CANDIDATES / prior) ** 2
    if components is not None:
        gain += REFINED_COMPONENT_WEIGHT * component_evidence(levels, components)
    return _near_prior(gain, REFINED_SOFTNESS, at_positives)


def proposals_around(iso: float, at_positives: np.ndarray) -> IsoProposals:
    """A chosen iso value with those of a larger structure, and of a smaller one that still holds most of the clicked points.

    Args:
        iso: the chosen one.
        at_positives: (P, …) values of the map at the class's positive points, P ≥ 1.
    """
    highest = SMALLER_SHARE_OF_POSITIVES * _reached_by_most(at_positives)
    smaller = min(max(min(SMALLER * iso, highest), LEAST_STEP * iso), LARGEST_ISO)
    return IsoProposals(smaller, iso, LARGER * iso)


def edge_strength_at(cdf: IntensityCdf, points_ras: np.ndarray, steps_ras: np.ndarray) -> np.ndarray:
    """Gradient magnitude of the intensities' CDF, over its mean, (N,) float32.

    Args:
        cdf: of the volume.
        points_ras: (N, 3) RAS millimetres.
        steps_ras: (3, 3), one in each row: steps along the volume's own axes over which differences are taken, to either side.
            Along the patient's, an oblique volume would have other edges than the same volume stored along the patient's axes.
    """
    squared = np.zeros(len(points_ras), dtype=np.float32)
    for step in steps_ras:
        squared += (cdf.at(points_ras + step) - cdf.at(points_ras - step)) ** 2
    strength = np.sqrt(squared)
    return strength / max(float(strength.mean()), 1e-12)


def iso_between_points(at_positives: np.ndarray, at_negatives: np.ndarray) -> float:
    """The iso value that lies in the middle between the points to include and those to exclude.

    Args:
        at_positives: (N, …) the class's map, in [0, 1], at its own positive points, N ≥ 1.
        at_negatives: (M,) the same map at the points that speak against the class (`points_against`), M ≥ 0.

    Returns:
        The middle between the means of the two groups, or half of the positives' mean where there are no negatives; never so
        low or high that everything or nothing would be selected.
    """
    include = float(np.mean(at_positives))
    exclude = float(np.mean(at_negatives)) if len(at_negatives) else 0.0
    return float(np.clip(0.5 * (include + exclude), SMALLEST_ISO, LARGEST_ISO))


def _strength_along_surfaces(levels: Levels, edge_strength: np.ndarray) -> np.ndarray:
    """Mean edge strength near the iso-surface of each candidate, (candidates,)."""
    # A histogram over log levels: the edge strength at every level costs one pass over the map.
    near = _near(SURFACE_WIDTH)
    total = near @ np.bincount(levels.bins, edge_strength[levels.seen], _BINS)
    mean: np.ndarray = total / (near @ np.bincount(levels.bins, minlength=_BINS) + 1e-9)
    return mean


def _log_instability(voxels: Iterable[tuple[np.ndarray, float]], between: Between) -> np.ndarray:
    """Logarithm of the share of the enclosed volume that a change of the iso value moves, for each candidate."""
    count = np.zeros(_BINS)
    for values, voxels_each in voxels:
        flat = values.reshape(-1)
        for start in range(0, flat.size, VALUES_AT_ONCE):
            between()
            some = flat[start : start + VALUES_AT_ONCE]
            count += voxels_each * np.bincount(_bins(some[some > LOWEST_LEVEL]), minlength=_BINS)
    enclosed = np.interp(np.log(CANDIDATES), np.log(_LEVELS), count[::-1].cumsum()[::-1])
    near = _near(STABILITY_WIDTH)
    per_unit = (near @ count) / near.sum(axis=1) * (_BINS - 1) / -np.log(LOWEST_LEVEL)
    instability: np.ndarray = np.log(per_unit / (enclosed + 1e-9) + STABILITY_FLOOR)
    return instability


def _near_prior(gain: np.ndarray, softness: float, at_positives: np.ndarray) -> float:
    """The mean of the candidates, weighted by their gain; at most `LARGEST_SHARE_OF_POSITIVES` allows."""
    weights = np.exp((gain - gain.max()) / softness)
    best = float(np.exp((weights * np.log(CANDIDATES)).sum() / weights.sum()))
    return min(best, max(LARGEST_SHARE_OF_POSITIVES * _reached_by_most(at_positives), LOWEST_LEVEL))


def _reached_by_most(at_positives: np.ndarray) -> float:
    """The largest value that most points' values reach: more than half of them, so that of two points it is the lower one."""
    ordered = np.sort(at_positives, axis=None)
    return float(ordered[(len(ordered) - 1) // 2])


def _bins(similarity: np.ndarray) -> np.ndarray:
    """The logarithmic level, an index to `_LEVELS`, of values above `LOWEST_LEVEL`."""
    # In the values' own precision, which one of NumPy's numbers would raise.
    depth = -math.log(LOWEST_LEVEL)
    bins: np.ndarray = np.clip((np.log(similarity) + depth) * ((_BINS - 1) / depth), 0, _BINS - 1).astype(int)
    return bins


@cache
def _near(width: float) -> np.ndarray:
    """How much each level counts for the surface at each candidate, (candidates, levels)."""
    return np.exp(-0.5 * ((np.log(_LEVELS) - np.log(CANDIDATES)[:, None]) / width) ** 2)
