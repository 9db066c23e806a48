"""How much connectedness counts in the kernel of annotated points.

The kernel's rows of a point p are multiplied by (1 − b) + b C_p: what is joined to p by intensities like its own stays as
similar as it was, all else becomes less so. How much that may count, b, the class's own positive points say: if they are joined
among themselves, what is not joined to them is unlikely to be theirs; two lungs, or a heart's blood and muscle, are not.

    b = B · (Σ_{p<q} C_pq + ½) / (pairs + 1)

over the pairs of the class's positive points; its negative points share its b.
"""

from __future__ import annotations

import numpy as np

from .connectedness import SIMILARITIES, Connectedness

LARGEST_SHARE = 0.8
"""B: of a class none of whose points is joined to another by more than noise."""


class ConnectedPoints:
    """Connectedness of the annotated points with all cells, kept from click to click.

    Args:
        connectedness: of the volume.
    """

    def __init__(self, connectedness: Connectedness) -> None:
        self._connectedness = connectedness
        self._levels_of_key: dict[bytes, np.ndarray] = {}

    def update(self, points_ras: np.ndarray) -> None:
        """Find out about points (P, 3), RAS millimetres, that are new, and forget those that are gone."""
        points = {point.tobytes(): point for point in points_ras}
        known = self._levels_of_key
        self._levels_of_key = {
            key: known[key] if key in known else self._connectedness.from_point(point) for key, point in points.items()
        }

    def at(self, points_ras: np.ndarray, cells: np.ndarray | slice = slice(None)) -> np.ndarray:
        """C of points (P, 3), which `update` was told of, at cells given by their indices (n,), (P, n) float32."""
        levels = np.stack([self._levels_of_key[point.tobytes()][cells] for point in points_ras])
        similarities: np.ndarray = SIMILARITIES[levels]
        return similarities


def between_points(at_points: np.ndarray) -> np.ndarray:
    """C of pairs of points, symmetric with a diagonal of 1: either's own intensity may be the one that joins them.

    Args:
        at_points: (P, P), C of each point at the cells of all.
    """
    between: np.ndarray = np.maximum(at_points, at_points.T)
    np.fill_diagonal(between, 1.0)
    return between


def shares(between: np.ndarray, classes: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """B of each point, (P,) in [0, `LARGEST_SHARE`].

    Args:
        between: (P, P) C of pairs of points, symmetric.
        classes: (P,) the class that each point belongs to.
        positive: (P,) bool, whether it is a positive point of that class.
    """
    found = np.empty(len(classes))
    for index in np.unique(classes):
        own = (classes == index) & positive
        count = np.count_nonzero(own)
        joined = np.triu(between[np.ix_(own, own)], 1).sum()
        found[classes == index] = LARGEST_SHARE * (joined + 0.5) / (count * (count - 1) / 2 + 1)
    return found


def point_factors(between: np.ndarray, share: np.ndarray) -> np.ndarray:
    """What the kernel between points is multiplied by, (P, P): 1 on the diagonal; for two points of equal b, (1 − b) + b C."""
    unjoined = 1.0 - share
    factors: np.ndarray = np.sqrt(np.outer(unjoined, unjoined)) + np.sqrt(np.outer(share, share)) * between
    return factors
