"""Components of similar intensities around a class's points, at growing tolerances: how far the structure may extend.

A point's component at a tolerance t consists of the cells that are connected to it by intensities within t of its own. If it
hardly grows with t, it has reached walls on all sides, as in a lung, a bladder full of contrast medium, or a kidney in its fat.
A single point can thus tell the extent of its structure, about which similarity to the point says little (maximally stable
extremal regions: Matas et al., 2002). If components keep growing, as in a brain, they tell nothing.

A cell that is connected to another class's points or to a negative point at a smaller tolerance belongs to no component of the
class: so two lungs end where they meet, although the airways connect them (relative fuzzy connectedness: Saha and Udupa, 2001).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, cached_property, reduce
from threading import Lock

import numpy as np

from ..core.classes.class_request import ClassRequest
from ..core.system.progress import Between, nothing_between
from ..core.volumes.geometry import Geometry
from .connectedness import FloodedBlocks

TOLERANCES = 0.02 * 2.0 ** np.arange(6)
"""Tolerances, in widths of the display window."""
FEW_CELLS = 30
"""A component of this many cells counts half as much as a large one: a single noisy cell stays alone at many tolerances."""
LARGEST_SHARE = 0.5
"""A component with a larger share of the volume, or of the body, is no structure in it."""
CLOSED = 0.9
"""Least stability of a closed component, which has walls on all sides."""
LARGEST_CUT = 0.005
"""A component with a larger share of its cells at the volume's faces continues outside, so that its extent is unknown."""
_FLOODED = np.append(TOLERANCES, 2.0 * TOLERANCES[-1])
"""All tolerances that are flooded: one more than `TOLERANCES`, to see whether the last one is stable."""
_NEVER = np.uint8(len(_FLOODED))


class StableComponents:
    """Components around the annotated points; kept from click to click.

    They are stored as steps: for each cell, the number of `TOLERANCES` that are too small to connect it, uint8; if all are too
    small, `len(TOLERANCES)`.

    Args:
        units: intensities of all cells (K, J, I), int16 (`IntensityBlocks.cell_units`).
        cells: geometry of the cells.
        some: indices of the cells for which `of_class` returns steps, (N,).
        count_body: returns the number of cells that are not background around the body; called at most once, if needed.
    """

    def __init__(self, units: np.ndarray, cells: Geometry, some: np.ndarray, count_body: Callable[[], int]) -> None:
        self._flooded, self._cells, self._some = FloodedBlocks(units), cells, some
        self._body = cache(count_body)
        self._faces = _at_faces(units.shape)
        self._of_point: dict[bytes, _AroundPoint] = {}
        self._of_group: dict[bytes, _AroundGroup] = {}
        self._looking = Lock()

    def update(self, requests: Sequence[ClassRequest], between: Between = nothing_between) -> None:
        """Compute components of new points, some milliseconds each, and drop those of removed points. Any thread may call this.

        Args:
            requests: all classes.
            between: called before each new point; may raise `Cancelled`, and components computed by then are kept.
        """
        with self._looking:
            self._learn(requests, between)

    def of_class(self, requests: Sequence[ClassRequest], index: int) -> np.ndarray:
        """Steps of the index-th class at `some` cells, (N,) uint8. Any thread may call this."""
        with self._looking:
            own, rivals = self._around(requests, index)
            steps, of_rivals = own.at_some, [rival.at_some for rival in rivals]
        if of_rivals:
            steps = np.where(reduce(np.minimum, of_rivals) < steps, np.uint8(len(TOLERANCES)), steps)
        return steps

    def closed(self, requests: Sequence[ClassRequest], index: int) -> np.ndarray | None:
        """The closed components of the index-th class, (cells,) bool; None if there are none. Any thread may call this.

        A component must end within the volume and be stable before other classes' cells are removed from it, because those
        limit its size even where it has leaked into its surroundings. It must also be that of a single point: of three points
        in a stomach that leak, each at another tolerance, the common component is large early and then seems stable.
        """
        with self._looking:
            own, rivals = self._around(requests, index)
            steps = own.closed
            of_rivals = [] if steps is None else [rival.steps for rival in rivals]
        if steps is None:
            return None
        nearest: np.ndarray | np.uint8 = reduce(np.minimum, of_rivals) if of_rivals else _NEVER
        closed: np.ndarray = (steps <= nearest) & (steps < _NEVER)
        return closed

    def _around(self, requests: Sequence[ClassRequest], index: int) -> tuple[_AroundGroup, list[_AroundGroup]]:
        """The components around a class's positive points, and around each group of points that speaks against it."""
        self._learn(requests)
        others = [request.positive for number, request in enumerate(requests) if number != index]
        rivals = [points for points in (requests[index].negative, *others) if len(points)]
        return self._of_group[requests[index].positive.tobytes()], [self._of_group[points.tobytes()] for points in rivals]

    def _learn(self, requests: Sequence[ClassRequest], between: Between = nothing_between) -> None:
        groups = {points.tobytes(): points for request in requests for points in (request.positive, request.negative)}
        points = {point.tobytes(): point for group in groups.values() for point in group}
        self._of_point = {key: at_point for key, at_point in self._of_point.items() if key in points}
        for key, point in points.items():
            if key not in self._of_point:
                between()
                (cell,) = self._cells.nearest_voxels(point[None])
                steps = self._flooded.tolerances_too_small(cell, _FLOODED).ravel()
                self._of_point[key] = _AroundPoint(steps, self._some, self._closed(steps))
        known = self._of_group
        self._of_group = {
            key: known.get(key) or _AroundGroup([self._of_point[point.tobytes()] for point in group])
            for key, group in groups.items()
        }

    def _closed(self, steps: np.ndarray) -> np.ndarray | None:
        """Steps at all cells, `_NEVER` outside the most stable component; None if that is not closed."""
        sizes, at_faces = component_sizes(steps, len(_FLOODED)), component_sizes(steps[self._faces], len(_FLOODED))
        stable = np.where(at_faces <= LARGEST_CUT * sizes, stability(sizes, len(steps)), 0.0)[: len(TOLERANCES)]
        if stable.max() >= CLOSED:
            # A body surrounded by air is stable as well, but no structure.
            stable[sizes[: len(TOLERANCES)] > LARGEST_SHARE * self._body()] = 0.0
        reach = stable.argmax()
        return np.where(steps <= reach, steps, _NEVER) if stable[reach] >= CLOSED else None


class _AroundPoint:
    """The components of one point.

    Attributes:
        steps: steps at all cells, counted in `_FLOODED`, uint8.
        at_some: steps at `some` cells, counted in `TOLERANCES`.
        closed: result of `StableComponents._closed`.
    """

    def __init__(self, steps: np.ndarray, some: np.ndarray, closed: np.ndarray | None) -> None:
        self.steps, self.closed = steps, closed
        self.at_some = np.minimum(steps[some], np.uint8(len(TOLERANCES)))


class _AroundGroup:
    """The union of the components of several points; attributes as of `_AroundPoint`."""

    def __init__(self, points: Sequence[_AroundPoint]) -> None:
        self._points = points

    @cached_property
    def steps(self) -> np.ndarray:
        return reduce(np.minimum, [point.steps for point in self._points])

    @cached_property
    def at_some(self) -> np.ndarray:
        return reduce(np.minimum, [point.at_some for point in self._points])

    @cached_property
    def closed(self) -> np.ndarray | None:
        closed = [point.closed for point in self._points if point.closed is not None]
        return reduce(np.minimum, closed) if closed else None


def _at_faces(shape: tuple[int, ...]) -> np.ndarray:
    """Indices of the cells in a volume's outermost layer."""
    inner = np.zeros(shape, dtype=bool)
    inner[1:-1, 1:-1, 1:-1] = True
    return np.flatnonzero(~inner)


def component_sizes(steps: np.ndarray, tolerances: int = len(TOLERANCES)) -> np.ndarray:
    """Number of cells of the component at each tolerance, (tolerances,), from steps at these cells, uint8."""
    # Comparing bytes is so fast that NumPy's `bincount` would take twice as long.
    return np.array([np.count_nonzero(steps <= step) for step in range(tolerances)])


def stability(sizes: np.ndarray, whole: int) -> np.ndarray:
    """How little components change between a tolerance and its neighbours, (T,) in [0, 1]: near 1 if they keep their size.

    Args:
        sizes: (T,) number of their cells at each tolerance.
        whole: number of all cells.
    """
    grown = np.concatenate([[-1.0], sizes, [float(whole)]]) + 1.0
    kept = np.sqrt(grown[:-1] / grown[1:])
    stable = np.minimum(kept[:-1], kept[1:]) * sizes / (sizes + FEW_CELLS)
    of_structures: np.ndarray = np.where(sizes <= LARGEST_SHARE * whole, stable, 0.0)
    return of_structures
