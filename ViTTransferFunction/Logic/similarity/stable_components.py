"""What lies around a class's points and has intensities like theirs, at wider and wider tolerances: how far it may reach.

A point's component at a tolerance t are the cells that are joined to it by intensities no further than t from its own. Where it
hardly grows while t does, it has come to walls all around: a lung, a bladder full of contrast medium, a kidney in its fat. So
one point alone may tell how large its structure is, of which the similarity to it says little (maximally stable extremal
regions: Matas et al., 2002). Where components only grow, as in a brain, they tell nothing.

A cell that a smaller tolerance joins to another class's points, or to a negative one, belongs to no component of the class: so
two lungs end where they meet, although the airways join them (relative fuzzy connectedness: Saha and Udupa, 2001).
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
"""In widths of the display window."""
FEW_CELLS = 30
"""A component of so many cells tells half as much as a large one: a single noisy cell is joined to nothing for long."""
LARGEST_SHARE = 0.5
"""What holds more of the volume, or of the body, is no structure in it."""
CLOSED = 0.9
"""The stability of what is walled in."""
LARGEST_CUT = 0.005
"""What has more of its cells at the faces of the volume goes on outside, such as a body: nobody knows how far."""
_FLOODED = np.append(TOLERANCES, 2.0 * TOLERANCES[-1])
"""To see whether the last one is stable, the next is needed."""
_NEVER = np.uint8(len(_FLOODED))


class StableComponents:
    """Components around the annotated points; kept from click to click.

    They are given by how many of `TOLERANCES` are too small to join each cell, uint8: `len(TOLERANCES)` where all are.

    Args:
        units: intensities of all cells (K, J, I), int16 (`IntensityBlocks.cell_units`).
        cells: their geometry.
        some: indices of the cells that `of_class` is asked about, (N,).
        count_body: says how many cells hold more than the background around the body; asked once, and only if it matters.
    """

    def __init__(self, units: np.ndarray, cells: Geometry, some: np.ndarray, count_body: Callable[[], int]) -> None:
        self._flooded, self._cells, self._some = FloodedBlocks(units), cells, some
        self._body = cache(count_body)
        self._faces = _at_faces(units.shape)
        self._of_point: dict[bytes, _AroundPoint] = {}
        self._of_group: dict[bytes, _AroundGroup] = {}
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
        """The components of the index-th class at some cells, (N,) uint8. Any thread may ask."""
        with self._looking:
            own, rivals = self._around(requests, index)
            steps, of_rivals = own.at_some, [rival.at_some for rival in rivals]
        if of_rivals:
            steps = np.where(reduce(np.minimum, of_rivals) < steps, np.uint8(len(TOLERANCES)), steps)
        return steps

    def closed(self, requests: Sequence[ClassRequest], index: int) -> np.ndarray | None:
        """Where points of the index-th class are walled in: their most stable components, (cells,) bool; None where none is.

        A component has to end within the volume, and to be stable by itself, before other classes take their part: what they
        cut keeps its size also where it has leaked into all that surrounds it. And that of one point: three of a stomach that
        leak, each at another tolerance, have a component together that is large early and then stays. Any thread may ask.
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
        """Around a class's positive points, and around each group that speaks against it: its negative ones, other classes'."""
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
        """Steps at all cells as far as the most stable component reaches, if that is closed; None if none is."""
        sizes, at_faces = component_sizes(steps, len(_FLOODED)), component_sizes(steps[self._faces], len(_FLOODED))
        stable = np.where(at_faces <= LARGEST_CUT * sizes, stability(sizes, len(steps)), 0.0)[: len(TOLERANCES)]
        if stable.max() >= CLOSED:
            # A body stands in its air as a structure within walls does.
            stable[sizes[: len(TOLERANCES)] > LARGEST_SHARE * self._body()] = 0.0
        reach = stable.argmax()
        return np.where(steps <= reach, steps, _NEVER) if stable[reach] >= CLOSED else None


class _AroundPoint:
    """The components of one point.

    Attributes:
        steps: at all cells, of all that is flooded, uint8.
        at_some: at some, of `TOLERANCES`.
        closed: from `StableComponents._closed`.
    """

    def __init__(self, steps: np.ndarray, some: np.ndarray, closed: np.ndarray | None) -> None:
        self.steps, self.closed = steps, closed
        self.at_some = np.minimum(steps[some], np.uint8(len(TOLERANCES)))


class _AroundGroup:
    """The components of points, each as far as that of any; attributes as of `_AroundPoint`."""

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
    """The cells of a volume's outermost layer: their indices."""
    inner = np.zeros(shape, dtype=bool)
    inner[1:-1, 1:-1, 1:-1] = True
    return np.flatnonzero(~inner)


def component_sizes(steps: np.ndarray, tolerances: int = len(TOLERANCES)) -> np.ndarray:
    """How many cells components have, (tolerances,), by their steps at these cells, uint8."""
    # Bytes are compared so fast that to count them all in one go takes twice as long.
    return np.array([np.count_nonzero(steps <= step) for step in range(tolerances)])


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
