"""Decides whether a map suggests a close-up, because the structure's extent depends strongly on the threshold."""

from __future__ import annotations

import numpy as np

from .class_map import ClassMap
from .close_up_choice import clicked_components

LOWER = 0.8
"""The lower threshold of the comparison, as a share of the iso value."""
MUCH_LARGER = 1.5
"""Growth from which an extent is vague; chosen on three scans, see `Benchmarks/results/candidates.md`, *When a closer look is
suggested*."""


def is_vague(similarity: ClassMap, points_ras: np.ndarray) -> bool:
    """Whether the components around a structure's points are at least half as large again if the threshold is a fifth lower.

    They hardly change if the features tell the structure from its surroundings. Around a structure that is too small or thin
    for the features, the map does not end at its edge.

    Args:
        similarity: map on the whole volume's cells.
        points_ras: the structure's positive points (N, 3), N ≥ 1, RAS millimetres.
    """
    found, more = (clicked_components(similarity, points_ras, share * similarity.iso).sum() for share in (1.0, LOWER))
    return bool(more >= MUCH_LARGER * found > 0)
