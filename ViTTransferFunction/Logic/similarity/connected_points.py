"""How much connectedness counts in the kernel of annotated points.

The kernel's rows of a point p are multiplied by (1 − b) + b C_p: what is joined to p by intensities like its own stays as
similar as it was, all else becomes less so. How much that may count, b, the class's own positive points say: if they are joined
among themselves, what is not joined to them is unlikely to be theirs; two lungs, or a heart's blood and muscle, are not.

    b = B · (Σ_{p<q} C_pq + ½) / (pairs + 1)

over the pairs of the class's positive points; its negative points share its b.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from ..core.classes.class_request import different_places
from ..core.system.progress import Between, nothing_between
from .connectedness import SIMILARITIES, Connectedness
from .intensity_blocks import IntensityBlocks

LARGEST_SHARE = 0.8
"""B: of a class whose many points are all joined."""
FINELY_JOINED_POINTS = 400
"""With more points than these, of all classes, one block a cell has to do: eight times as fast, and less able to tell."""


class ConnectedPoints:
    """Connectedness of the annotated points with all cells, kept from click to click.

    Args:
        blocks: of the volume.
        coarse_blocks: makes those that are as large as cells.
    """

    def __init__(self, blocks: IntensityBlocks, coarse_blocks: Callable[[], IntensityBlocks]) -> None:
        self._fine = Connectedness(blocks)
        self._coarse_blocks = coarse_blocks
        self._levels_of_key: dict[bytes, np.ndarray] = {}

    @cached_property
    def _coarse(self) -> Connectedness:
        # It takes a walk through the volume, and few users ever place so many points.
        return Connectedness(self._coarse_blocks())

    def keys(self, points_ras: np.ndarray) -> list[bytes]:
        """A key for each point (P, 3), RAS millimetres: another one where something else is known of it than before."""
        finely = bytes([_finely(points_ras)])
        return [finely + point.tobytes() for point in points_ras]

    def update(self, points_ras: np.ndarray, between: Between = nothing_between) -> list[bytes]:
        """Find out about points (P, 3), RAS millimetres, that are new, and forget those that are gone.

        Args:
            points_ras: all that are annotated.
            between: called before each new point; may raise `Cancelled`, and what was found out until then is kept.

        Returns:
            `keys`.
        """
        keys = self.keys(points_ras)
        connectedness = self._fine if _finely(points_ras) else self._coarse
        for gone in self._levels_of_key.keys() - set(keys):
            del self._levels_of_key[gone]
        for key, point in zip(keys, points_ras, strict=True):
            if key not in self._levels_of_key:
                between()
                self._levels_of_key[key] = connectedness.from_point(point)
        return keys

    def at(self, keys: Sequence[bytes], cells: np.ndarray | slice = slice(None)) -> np.ndarray:
        """C of points, by the keys from `update`, at cells given by their indices (n,), (P, n) float32."""
        levels = np.stack([self._levels_of_key[key][cells] for key in keys])
        # Half as long as by an index in brackets.
        similarities: np.ndarray = SIMILARITIES.take(levels)
        return similarities


def _finely(points_ras: np.ndarray) -> bool:
    """Whether points are few enough, each place counted once."""
    return len(different_places(points_ras)) <= FINELY_JOINED_POINTS


def between_points(at_points: np.ndarray) -> np.ndarray:
    """C of pairs of points, symmetric with a diagonal of 1: either's own intensity may be the one that joins them.

    Args:
        at_points: (P, P), C of each point at the cells of all.
    """
    between: np.ndarray = np.maximum(at_points, at_points.T)
    np.fill_diagonal(between, 1.0)
    return between


def shares(points_ras: np.ndarray, between: np.ndarray, classes: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """The share b of each point, (P,) in [0, `LARGEST_SHARE`].

    Args:
        points_ras: (P, 3) RAS millimetres; the same place counts once.
        between: (P, P) C of pairs of points, symmetric.
        classes: (P,) the class that each point belongs to.
        positive: (P,) bool, whether it is a positive point of that class.
    """
    found = np.empty(len(classes))
    for index in np.unique(classes):
        own = np.flatnonzero((classes == index) & positive)
        own = own[different_places(points_ras[own])]
        count = len(own)
        joined = np.triu(between[np.ix_(own, own)], 1).sum()
        found[classes == index] = LARGEST_SHARE * (joined + 0.5) / (count * (count - 1) / 2 + 1)
    return found


def point_factors(between: np.ndarray, share: np.ndarray) -> np.ndarray:
    """What the kernel between points is multiplied by, (P, P): 1 on the diagonal; for two points of equal b, (1 − b) + b C."""
    unjoined = 1.0 - share
    chained = np.sqrt(np.outer(share, share)) * joined_by_chains(between)
    factors: np.ndarray = np.sqrt(np.outer(unjoined, unjoined)) + chained
    return factors


def joined_by_chains(between: np.ndarray) -> np.ndarray:
    """C of pairs of points where they may be joined by way of other points: the largest weakest link of any chain, (P, P).

    C itself is no kernel: a point may be joined to two that are not joined to each other, and the regression's system of
    equations then is indefinite, so that many points spoil the map. Chained, it is an ultrametric, which is positive
    semidefinite always.

    Args:
        between: (P, P) C of pairs of points, symmetric with a diagonal of 1.
    """
    # In bytes, each the rank of a similarity: to go by way of one point after the other is then quick up to hundreds of points.
    ascending = SIMILARITIES[::-1]
    ranks = (np.searchsorted(ascending, between, side="right") - 1).astype(np.uint8)
    for by_way_of in range(len(ranks)):
        np.maximum(ranks, np.minimum(ranks[:, by_way_of, None], ranks[by_way_of]), out=ranks)
    chained: np.ndarray = ascending[ranks].astype(between.dtype)
    np.fill_diagonal(chained, 1.0)
    return chained
