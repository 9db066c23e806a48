"""Limits the reach of points that correct an existing result, by a factor on their kernels.

A later positive point is placed where the result of the earlier ones misses a part of the structure, mostly at a thin rim. If
it looks unlike them but like much else, its kernel would also raise the map elsewhere. Therefore the kernel of the n-th
positive point p of a class, in the order placed, is multiplied by

    (1 − w) + w exp(−|x − p|² / 2ρ²),    ρ = max(R, c min {|x − p|: x ∈ F(p_m), m < n}),
    w = W (1 − max_m l(p_m, p)) (1 − (1 − r) min(1, A max_m |F(p_m)| / |F(p)|)),

where p_m are the earlier points, F(p) is the set of cells that p finds, those with k(p, x) ≥ `FOUND`, and l is the kernel of
features and intensities without positions. w is larger if the point looks less like the earlier ones and if its look is more
common than theirs; ρ is smaller if the point lies nearer to the cells that they find. How common its look is counts less if it
lies at the rim of these cells: then even a rare look, such as that of the fat beside a tumour, is not that of another part.
With d the distance from these cells, in cells, the point is taken to lie at their rim to the degree

    r = R_0 min(1, max(0, (d_1 − d) / (d_1 − d_0))) min(1, max_m l(p_m, p) / l_0),

less if it looks like none of the earlier ones at all, as the enhancing margin of a tumour whose necrosis was clicked. Between
two points, the factor is

    √((1 − w)(1 − w′)) + √(w w′) (2ρρ′ / (ρ² + ρ′²))^(3/2) exp(−|p − p′|² / (ρ² + ρ′²)),

which is positive semidefinite, since the second term is the overlap of two Gaussians.

A negative point q is placed where the map is too large. If it looks like the class itself, as a voxel at the rim does, its
kernel would remove the class along with the excess. Therefore its kernel is multiplied by the same factor, with

    ρ = max(R⁻, c⁻ min {|x − q|: x ∉ F(p_1)}),    w = W l(p_1, q),

where p_1 is the class's first positive point: w is larger if q looks more like p_1; ρ is smaller if q lies less deep
within the cells that p_1 finds. For all other points w is 0.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.classes.class_request import different_places
from .place_kernel import CellKernel, Places, alike, nearness

FIRST_POINTS = 6
"""Number of a class's first positive points whose reach may be limited; later ones have an unlimited reach."""
LARGEST_WEIGHT = 0.8
"""W: the largest w. A positive point has it if it is unlike all points before it and finds very many cells; a negative point,
if it looks exactly like the first positive point."""
AS_COMMON = 0.5
"""A: a point that finds at most A times as many cells as an earlier one is not more common, so that its reach is unlimited,
unless it lies at a rim."""
RIM_CELLS, DEEP_CELLS = 1.0, 3.0
"""d_0 and d_1, in cells: up to the first distance from the cells that earlier ones find, a point lies at their rim; from the
second on, it does not."""
RIM_LIKE = 0.15
"""l_0: a point at the rim looks at least this much like an earlier one, since its voxel is a part of the structure."""
LARGEST_RIM = 0.8
"""R_0: the largest r. The structure may go on in what looks like its rim, as a gyrus does."""
FOUND = 0.2
"""A point finds the cells with which its kernel is at least this."""
WIDER = 2.0
"""c: reach of a positive point, as a multiple of its distance from the cells that earlier ones find."""
SHORTEST_CELLS = 1.5
"""R, in cells: the shortest reach of positive points."""
NEGATIVES_WIDER, NEGATIVES_SHORTEST_CELLS = 3.0, 2.5
"""c⁻, and R⁻ in cells."""

WITHOUT_END = (1.0, 0.0)
"""ρ and w of points with unlimited reach; with w = 0, ρ has no effect."""


@dataclass(frozen=True, eq=False)
class Reach:
    """The reach of P points.

    Attributes:
        distance: ρ of each point, (P,), in units of σ_x.
        weight: w of each point, (P,) in [0, 1).
    """

    distance: np.ndarray
    weight: np.ndarray

    def factors(self, points: Places, others: Places) -> np.ndarray:
        """The factors for the kernel of P points with N other places, (P, N)."""
        weight = self.weight[:, None]
        factors: np.ndarray = (1.0 - weight) + weight * nearness(points, others, self.distance)
        return factors

    def factors_between(self, points: Places) -> np.ndarray:
        """The factors for the kernel between the points, (P, P): 1 on the diagonal."""
        squares = self.distance**2
        sums = squares[:, None] + squares
        positions = points.positions.astype(np.float64)
        apart = ((positions[:, None] - positions) ** 2).sum(axis=-1)
        overlap = (2.0 * np.outer(self.distance, self.distance) / sums) ** 1.5 * np.exp(-apart / sums)
        unchanged = 1.0 - self.weight
        factors: np.ndarray = np.sqrt(np.outer(unchanged, unchanged)) + np.sqrt(np.outer(self.weight, self.weight)) * overlap
        return factors


class PointReach:
    """The reach of points, kept between clicks.

    Args:
        with_cells: computes the kernel with all cells.
        cell: edge length of a cell, in units of σ_x.
    """

    def __init__(self, with_cells: CellKernel, cell: float) -> None:
        self._with_cells = with_cells
        self._cell = cell
        self._of_key: dict[bytes, tuple[float, float]] = {}
        self._found_by_key: dict[bytes, np.ndarray] = {}

    def keep(self, keys: Collection[bytes]) -> None:
        """Drop the reach of all points but those with these keys."""
        for kept in (self._of_key, self._found_by_key):
            for gone in kept.keys() - set(keys):
                del kept[gone]

    def apply_to_positive(
        self, key: bytes, point: Places, before: Sequence[bytes], points_before: Places, row: np.ndarray
    ) -> None:
        """Determine the reach of a positive point, and multiply its kernel with all cells by the factor.

        Args:
            key: identifies the point together with those before it.
            point: a single point.
            before: keys of the class's earlier positive points, for which this method was called before.
            points_before: the earlier points.
            row: the point's kernel with all cells, (cells,) float32, changed in place.
        """
        self._found_by_key[key] = np.flatnonzero(row >= FOUND)
        if before:
            apart = self._from_found(point, before, points_before)
            weight = self._weight(key, point, before, points_before, apart)
            if weight:
                self._multiply(key, point, max(SHORTEST_CELLS * self._cell, WIDER * apart), weight, row)

    def apply_to_negative(
        self, key: bytes, point: Places, before: Sequence[bytes], points_before: Places, row: np.ndarray
    ) -> None:
        """The same for a negative point. `before` contains only the class's first positive point."""
        (first,) = before
        depth = self._depth_in_found(point, first)
        if math.isfinite(depth):
            weight = LARGEST_WEIGHT * min(1.0, float(alike(points_before, point).max()))
            distance = max(NEGATIVES_SHORTEST_CELLS * self._cell, NEGATIVES_WIDER * depth)
            self._multiply(key, point, distance, weight, row)

    def _multiply(self, key: bytes, point: Places, distance: float, weight: float, row: np.ndarray) -> None:
        self._of_key[key] = distance, weight
        # In place and in float32, because a click must be answered in milliseconds.
        factors = self._with_cells.nearness(point, distance)[0]
        factors *= weight
        factors += 1.0 - weight
        row *= factors

    def _weight(self, key: bytes, point: Places, before: Sequence[bytes], points_before: Places, apart: float) -> float:
        """The weight w of a single point, given the earlier ones, at least one; it is `apart` from what they find, in σ_x."""
        most, found = max(len(self._found_by_key[each]) for each in before), len(self._found_by_key[key])
        as_rare = min(1.0, AS_COMMON * most / found) if found else 1.0
        like = min(1.0, float(alike(points_before, point).max()))
        near = float(np.interp(apart / self._cell, (RIM_CELLS, DEEP_CELLS), (1.0, 0.0)))
        at_rim = LARGEST_RIM * near * min(1.0, like / RIM_LIKE)
        return LARGEST_WEIGHT * (1.0 - like) * (1.0 - (1.0 - at_rim) * as_rare)

    def _from_found(self, point: Places, before: Sequence[bytes], points_before: Places) -> float:
        """Distance of a single point from the earlier ones, at least one, and the cells that they find, in units of σ_x."""
        positions = self._with_cells.cells.positions
        found = [points_before.positions, *(positions[self._found_by_key[key]] for key in before)]
        return math.sqrt(float(((np.concatenate(found) - point.positions) ** 2).sum(axis=1).min()))

    def _depth_in_found(self, point: Places, first: bytes) -> float:
        """Distance of a single point from the nearest cell that `first` does not find, in units of σ_x; inf if it finds all."""
        # The nearest cell is where a Gaussian around the point is highest. It is separable, and so faster to compute than
        # distances.
        near = self._with_cells.nearness(point, 1.0)[0]
        near[self._found_by_key[first]] = 0.0
        highest = min(1.0, float(near.max()))
        return math.sqrt(-2.0 * math.log(highest)) if highest else math.inf

    def of(self, keys: Sequence[bytes]) -> Reach:
        """The reach of points by their keys; unlimited for points whose reach was not determined."""
        distance, weight = np.array([self._of_key.get(key, WITHOUT_END) for key in keys]).reshape(-1, 2).T
        return Reach(distance, weight)


def points_before(points_ras: np.ndarray, classes: np.ndarray, positive: np.ndarray) -> dict[int, np.ndarray]:
    """The points whose reach may be limited, each with the positive points of its class on which the reach depends.

    Args:
        points_ras: (P, 3) RAS millimetres, a class's points in the order placed; the same place counts once.
        classes: (P,) the class of each point.
        positive: (P,) bool, whether it is a positive point of that class.

    Returns:
        Indices of points, by the index of the point whose reach depends on them. For each of a class's first positive points,
        and for later ones at the same place: the points before the first one at that place. For each negative point: the
        class's first positive point.
    """
    before: dict[int, np.ndarray] = {}
    for index in np.unique(classes[positive]):
        own = np.flatnonzero((classes == index) & positive)
        first = own[different_places(points_ras[own])[:FIRST_POINTS]]
        for count, point in enumerate(first):
            there = own[(points_ras[own] == points_ras[point]).all(axis=1)]
            before |= {int(each): first[:count] for each in there}
        before |= {int(point): first[:1] for point in np.flatnonzero((classes == index) & ~positive)}
    return before
