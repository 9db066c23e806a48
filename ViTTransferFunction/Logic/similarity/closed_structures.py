"""The map of a structure that its intensities close off all around, such as a lung: even within it, from the first point on.

Similarity falls off with the distance from the points, and wherever features change: a lung's map is at a fifth of its height
long before the lung ends, and no iso value tells the rest from what is as far away outside. Where a point is walled in
(`StableComponents.closed`), what lies within the walls is of the same structure in all likelihood, so that there

    S′(x) = √(S(x) · max S),

with the highest value within the walls: half as far below it, on a logarithmic scale. What is unlike the points stays lower.
"""

from __future__ import annotations

import numpy as np


def raise_within(closed: np.ndarray, similarity: np.ndarray) -> None:
    """Raise a class's map where it is closed off, in place.

    Args:
        closed: (cells,) bool, of at least one.
        similarity: (cells,) in [0, 1].
    """
    values = similarity[closed]
    similarity[closed] = np.sqrt(values * values.max())
