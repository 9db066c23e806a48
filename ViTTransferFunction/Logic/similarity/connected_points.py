"""The weight of connectedness in the kernel of annotated points.

The kernel of a point p is multiplied by (1 − b) + b C_p: cells that are connected to p by intensities like its own keep their
similarity, and all others lose some. The weight b depends on the class's own positive points: if these are connected with each
other, a cell that is not connected to them is unlikely to belong to the class. Points in two lungs, or in the blood and the
muscle of a heart, are not connected.

    b = B · (Σ_{p<q} C_pq + ½) / (pairs + 1)

where p and q are positive points of the class. Its negative points have the same b.
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
"""B: limit of b for many points that are all connected."""
FINELY_JOINED_POINTS = 400
"""If all classes together have more points than this, blocks are as large as cells, which is eight times as fast but less
exact."""


class ConnectedPoints:
    """Connectedness of the annotated points with all cells, kept between clicks.

    Args:
        blocks: intensity blocks of the volume.
        coarse_blocks: makes blocks that are as large as cells; called when they are first needed.
    """

    def __init__(self, blocks: IntensityBlocks, coarse_blocks: Callable[[], IntensityBlocks]) -> None:
        self._fine = Connectedness(blocks)
        self._coarse_blocks = coarse_blocks
        self._levels_of_key: dict[bytes, np.ndarray] = {}

    @cached_property
    def _coarse(self) -> Connectedness:
        # Made on demand: this reads the whole volume, and few users place so many points.
        return Connectedness(self._coarse_blocks())

    def keys(self, points_ras: np.ndarray) -> list[bytes]:
        """A key for each point (P, 3), RAS millimetres; it changes with the point, and with the size of the blocks."""
        finely = bytes([_finely(points_ras)])
        return [finely + point.tobytes() for point in points_ras]

    def update(self, points_ras: np.ndarray, between: Between = nothing_between) -> list[bytes]:
        """Compute the connectedness of new points, and drop that of points that are gone.

        Args:
            points_ras: all annotated points, (P, 3) RAS millimetres.
            between: called before each new point; may raise `Cancelled`. Points that are complete by then are kept.

        Returns:
            The keys of the points (`keys`).
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
        """C of points, given by their keys from `update`, at the cells with these indices (n,): (P, n) float32."""
        levels = np.stack([self._levels_of_key[key][cells] for key in keys])
        # Takes half as long as indexing.
        similarities: np.ndarray = SIMILARITIES.take(levels)
        return similarities


def _finely(points_ras: np.ndarray) -> bool:
    """Whether there are few enough points for small blocks; the same place counts once."""
    return len(different_places(points_ras)) <= FINELY_JOINED_POINTS


def between_points(at_points: np.ndarray) -> np.ndarray:
    """C of pairs of points, symmetric with a diagonal of 1: the larger one of both directions.

    Flood fills from two points differ, because each follows the intensity of its own point.

    Args:
        at_points: (P, P), C of each point at the cells of all points.
    """
    between: np.ndarray = np.maximum(at_points, at_points.T)
    np.fill_diagonal(between, 1.0)
    return between


def shares(points_ras: np.ndarray, between: np.ndarray, classes: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """The weight b of each point, (P,) in [0, `LARGEST_SHARE`].

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
    """The factors for the kernel between points, (P, P): 1 on the diagonal; (1 − b) + b C for two points with the same b."""
    unjoined = 1.0 - share
    chained = np.sqrt(np.outer(share, share)) * joined_by_chains(between)
    factors: np.ndarray = np.sqrt(np.outer(unjoined, unjoined)) + chained
    return factors


def joined_by_chains(between: np.ndarray) -> np.ndarray:
    """C of pairs of points that may be connected through other points, (P, P).

    It is the largest C that a chain of points can have, where C of a chain is that of its weakest link.

    C itself is no kernel. A point may be connected to two points that are not connected to each other, which makes the
    regression's equations indefinite, so that many points spoil the map. The C of chains is an ultrametric, and thus always
    positive semidefinite.

    Args:
        between: (P, P) C of pairs of points, symmetric with a diagonal of 1.
    """
    # Ranks of the similarities fit into bytes, which makes the Floyd–Warshall algorithm fast enough for hundreds of points.
    ascending = SIMILARITIES[::-1]
    ranks = (np.searchsorted(ascending, between, side="right") - 1).astype(np.uint8)
    for by_way_of in range(len(ranks)):
        np.maximum(ranks, np.minimum(ranks[:, by_way_of, None], ranks[by_way_of]), out=ranks)
    chained: np.ndarray = ascending[ranks].astype(between.dtype)
    np.fill_diagonal(chained, 1.0)
    return chained
