"""What lies around a class's points and has intensities like theirs, at wider and wider tolerances: how far it may reach.

A point's component at a tolerance t are the cells that are joined to it by intensities no further than t from its own. Where it
hardly grows while t does, it has come to walls all around: a lung, a bladder full of contrast medium, a kidney in its fat. So
one point alone may tell how large its structure is, of which the similarity to it says little (maximally stable extremal
regions: Matas et al., 2002). Where components only grow, as in a brain, they tell nothing.

A cell that a smaller tolerance joins to another class's points, or to a negative one, belongs to no component of the class: so
two lungs end where they meet, although the airways join them (relative fuzzy connectedness: Saha and Udupa, 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock

import numpy as np

from ..core.class_request import ClassRequest
from ..core.geometry import Geometry
from ..core.progress import Between, nothing_between
from .connectedness import tolerances_too_small

TOLERANCES = 0.02 * 2.0 ** np.arange(6)
"""In widths of the display window."""
FEW_CELLS = 30
"""A component of so many cells tells half as much as a large one: a single noisy cell is joined to nothing for long."""
LARGEST_SHARE = 0.5
"""What holds more of the volume is no structure in it."""


class StableComponents:
    """Components around the annotated points, at some cells of a volume; kept from click to click.

    They are given by how many of `TOLERANCES` are too small to join each cell, (N,) uint8: `len(TOLERANCES)` where all are.

    Args:
        units: intensities of all cells (K, J, I), int16 (`Connectedness.cell_units`).
        cells: their geometry.
        some: indices of the cells that are asked about, (N,).
    """

    def __init__(self, units: np.ndarray, cells: Geometry, some: np.ndarray) -> None:
        self._units, self._cells, self._some = units, cells, some
        self._of_point: dict[bytes, np.ndarray] = {}
        self._of_group: dict[bytes, np.ndarray] = {}
        self._looking = Lock()

    def update(self, requests: Sequence[ClassRequest], between: Between = nothing_between) -> None:
        """Find out about points that are new, some milliseconds each, and forget those that are gone. Any thread may.

        Args:
            requests: all classes.
            between: called before each new point; may raise `Cancelled`, and what was found out until then is kept.
        """
        with self._looking:
            self._learn(requests, between)

    def of_class(self, requests: Sequence[ClassRequest], index: int) -> np.ndarray:
        """The components of the index-th class, (N,) uint8. Any thread may ask."""
        groups = [request.positive for request in requests]
        own = groups.pop(index)
        with self._looking:
            self._learn(requests)
            steps = self._around_any(own)
            rivals = [self._around_any(points) for points in (requests[index].negative, *groups) if len(points)]
        if rivals:
            steps = np.where(np.minimum.reduce(rivals) < steps, np.uint8(len(TOLERANCES)), steps)
        return steps

    def _learn(self, requests: Sequence[ClassRequest], between: Between = nothing_between) -> None:
        groups = {points.tobytes(): points for request in requests for points in (request.positive, request.negative)}
        points = {point.tobytes(): point for group in groups.values() for point in group}
        self._of_group = {key: steps for key, steps in self._of_group.items() if key in groups}
        self._of_point = {key: steps for key, steps in self._of_point.items() if key in points}
        for key, point in points.items():
            if key not in self._of_point:
                between()
                self._of_point[key] = self._around(point)

    def _around_any(self, points_ras: np.ndarray) -> np.ndarray:
        """Around any of some points (P, 3), P ≥ 1."""
        key = points_ras.tobytes()
        if key not in self._of_group:
            self._of_group[key] = np.minimum.reduce([self._of_point[point.tobytes()] for point in points_ras])
        return self._of_group[key]

    def _around(self, point_ras: np.ndarray) -> np.ndarray:
        (cell,) = self._cells.nearest_voxels(point_ras[None])
        at_cells: np.ndarray = tolerances_too_small(self._units, cell, TOLERANCES).ravel()[self._some]
        return at_cells


def stability(sizes: np.ndarray, whole: int) -> np.ndarray:
    """How little components change from each tolerance to those beside it, (T,) in [0, 1]: next to 1 where they stay.

    Args:
        sizes: (T,) how many cells they have, by tolerance; the first and the last are mainly there to be compared with.
        whole: how many cells there are.
    """
    grown = np.concatenate([[-1.0], sizes, [float(whole)]]) + 1.0
    kept = np.sqrt(grown[:-1] / grown[1:])
    stable = np.minimum(kept[:-1], kept[1:]) * sizes / (sizes + FEW_CELLS)
    of_structures: np.ndarray = np.where(sizes <= LARGEST_SHARE * whole, stable, 0.0)
    return of_structures
