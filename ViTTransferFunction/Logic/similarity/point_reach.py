"""How far the kernels of points reach that correct what is there already.

A later positive point was placed where those before did not find its structure: at a rim, mostly, and a rim is thin. Where it
looks unlike them and like much else, its kernel would raise all of that as well. So of the n-th positive point p of a class, in
the order placed, the kernel is multiplied by

    (1 − w) + w exp(−|x − p|² / 2ρ²),    ρ = max(R, c min {|x − p|: x ∈ F(p_m), m < n}),
    w = W (1 − max_m l(p_m, p)) (1 − min(1, A max_m |F(p_m)| / |F(p)|)),

with p_m the points before it, F(p) the cells that it finds, those with k(p, x) ≥ `FOUND`, and l the kernel of features and
intensities without positions. It reaches the less far the less it looks like those points, the more common its look is than
theirs, and the nearer it lies to what they find. Between two points, the factor is

    √((1 − w)(1 − w′)) + √(w w′) (2ρρ′ / (ρ² + ρ′²))^(3/2) exp(−|p − p′|² / (ρ² + ρ′²)),

which is positive semidefinite: the second term is how much two Gaussians have in common.

A negative point q was placed where too much was found. Where it looks like the class itself, as a voxel at its rim does, its
kernel would take the class away along with what is too much. So it is multiplied by the same, with

    ρ = max(R⁻, c⁻ min {|x − q|: x ∉ F(p_1)}),    w = W l(p_1, q),

p_1 the class's first positive point: it reaches the less far the more it looks like that one, and the less deep it lies in what
that one finds. Of all other points w is 0.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.classes.class_request import different_places
from .place_kernel import CellKernel, Places, alike, nearness

FIRST_POINTS = 6
"""The reach of so many different positive points of a class is looked at: those after them reach without an end."""
LARGEST_WEIGHT = 0.8
"""W: of a positive point that is unlike all before it, and finds very many cells, and of a negative one that is just like the
first."""
AS_COMMON = 0.5
"""A: a point that finds no more than 1 / A times as many cells as one before it is as common, and reaches without an end."""
FOUND = 0.2
"""Cells whose kernel with a point is no less are found by it."""
WIDER = 2.0
"""c: reach, as a multiple of the distance from what was found."""
SHORTEST_CELLS = 1.5
"""R, in cells: no positive point reaches less far."""
NEGATIVES_WIDER, NEGATIVES_SHORTEST_CELLS = 3.0, 2.5
"""c⁻, and R⁻ in cells."""

WITHOUT_END = (1.0, 0.0)
"""ρ and w of other points: any ρ, which does not count."""


@dataclass(frozen=True, eq=False)
class Reach:
    """How far points reach.

    Attributes:
        distance: ρ of each, (P,), in units of σ_x.
        weight: w of each, (P,) in [0, 1): how much that counts.
    """

    distance: np.ndarray
    weight: np.ndarray

    def factors(self, points: Places, others: Places) -> np.ndarray:
        """What the kernel of points (P) with other places (N) is multiplied by, (P, N)."""
        weight = self.weight[:, None]
        factors: np.ndarray = (1.0 - weight) + weight * nearness(points, others, self.distance)
        return factors

    def factors_between(self, points: Places) -> np.ndarray:
        """What the kernel between the points is multiplied by, (P, P): 1 on the diagonal."""
        squares = self.distance**2
        sums = squares[:, None] + squares
        positions = points.positions.astype(np.float64)
        apart = ((positions[:, None] - positions) ** 2).sum(axis=-1)
        overlap = (2.0 * np.outer(self.distance, self.distance) / sums) ** 1.5 * np.exp(-apart / sums)
        unchanged = 1.0 - self.weight
        factors: np.ndarray = np.sqrt(np.outer(unchanged, unchanged)) + np.sqrt(np.outer(self.weight, self.weight)) * overlap
        return factors


class PointReach:
    """The reach of points, kept from click to click.

    Args:
        with_cells: makes the kernel with all cells.
        cell: the edge of one, in units of σ_x.
    """

    def __init__(self, with_cells: CellKernel, cell: float) -> None:
        self._with_cells = with_cells
        self._cell = cell
        self._of_key: dict[bytes, tuple[float, float]] = {}
        self._found_by_key: dict[bytes, np.ndarray] = {}

    def keep(self, keys: Collection[bytes]) -> None:
        """Forget what is known of all other keys."""
        for kept in (self._of_key, self._found_by_key):
            for gone in kept.keys() - set(keys):
                del kept[gone]

    def apply_to_positive(
        self, key: bytes, point: Places, before: Sequence[bytes], points_before: Places, row: np.ndarray
    ) -> None:
        """Find out how far a positive point reaches, and multiply its kernel with all cells by what follows.

        Args:
            key: whatever is another one where the point or those before are others.
            point: one.
            before: the keys of the class's positive points placed before it, which this was called for already.
            points_before: these.
            row: its kernel with all cells, (cells,) float32, which is changed.
        """
        self._found_by_key[key] = np.flatnonzero(row >= FOUND)
        weight = self._weight(key, point, before, points_before) if before else 0.0
        if weight:
            distance = max(SHORTEST_CELLS * self._cell, WIDER * self._from_found(point, before, points_before))
            self._multiply(key, point, distance, weight, row)

    def apply_to_negative(
        self, key: bytes, point: Places, before: Sequence[bytes], points_before: Places, row: np.ndarray
    ) -> None:
        """The same of a negative point, by the class's first positive point: the only one in `before`."""
        (first,) = before
        depth = self._depth_in_found(point, first)
        if math.isfinite(depth):
            weight = LARGEST_WEIGHT * min(1.0, float(alike(points_before, point).max()))
            distance = max(NEGATIVES_SHORTEST_CELLS * self._cell, NEGATIVES_WIDER * depth)
            self._multiply(key, point, distance, weight, row)

    def _multiply(self, key: bytes, point: Places, distance: float, weight: float, row: np.ndarray) -> None:
        self._of_key[key] = distance, weight
        # In place, and in float32: there are as many cells as a click has milliseconds for.
        factors = self._with_cells.nearness(point, distance)[0]
        factors *= weight
        factors += 1.0 - weight
        row *= factors

    def _weight(self, key: bytes, point: Places, before: Sequence[bytes], points_before: Places) -> float:
        """How much the reach of a point (one) counts, w, given those before it, at least one."""
        most, found = max(len(self._found_by_key[each]) for each in before), len(self._found_by_key[key])
        if found <= AS_COMMON * most:
            return 0.0
        unlike = 1.0 - min(1.0, float(alike(points_before, point).max()))
        return LARGEST_WEIGHT * unlike * (1.0 - AS_COMMON * most / found)

    def _from_found(self, point: Places, before: Sequence[bytes], points_before: Places) -> float:
        """How far a point (one) lies from those before it, at least one, and what they find, in units of σ_x."""
        positions = self._with_cells.cells.positions
        found = [points_before.positions, *(positions[self._found_by_key[key]] for key in before)]
        return math.sqrt(float(((np.concatenate(found) - point.positions) ** 2).sum(axis=1).min()))

    def _depth_in_found(self, point: Places, first: bytes) -> float:
        """How far a point (one) lies from the next cell that another one does not find, in units of σ_x; inf: it finds all."""
        # The nearest one is where a Gaussian is highest: made of three lines, it is found much sooner than distances are.
        near = self._with_cells.nearness(point, 1.0)[0]
        near[self._found_by_key[first]] = 0.0
        highest = min(1.0, float(near.max()))
        return math.sqrt(-2.0 * math.log(highest)) if highest else math.inf

    def of(self, keys: Sequence[bytes]) -> Reach:
        """The reach of points by their keys: without an end for those of which nothing else is known."""
        distance, weight = np.array([self._of_key.get(key, WITHOUT_END) for key in keys]).reshape(-1, 2).T
        return Reach(distance, weight)


def points_before(points_ras: np.ndarray, classes: np.ndarray, positive: np.ndarray) -> dict[int, np.ndarray]:
    """The points whose reach is looked at, and those positive ones of their class by which each is judged.

    Args:
        points_ras: (P, 3) RAS millimetres, those of a class in the order placed; the same place counts once.
        classes: (P,) the class that each point belongs to.
        positive: (P,) bool, whether it is a positive point of that class.

    Returns:
        Of the index of each of a class's first positive points, and of any later one at the same place, the indices of those
        before the first one there; of each negative one, of the first positive one.
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
