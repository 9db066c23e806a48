"""When a map suggests a close-up: how far the structure reaches depends on the threshold."""

from __future__ import annotations

import numpy as np

from .class_map import ClassMap
from .close_up_choice import clicked_components

LOWER = 0.8
"""Of the iso value: the threshold that is tried as well."""
MUCH_LARGER = 1.5
"""What grows to so many times its size is vague; chosen on three scans, see `Benchmarks/results/candidates.md`, *When a closer
look is suggested*."""


def is_vague(similarity: ClassMap, points_ras: np.ndarray) -> bool:
    """Whether what is found around a structure's points is half as large again where the threshold is a fifth lower.

    A structure that the features tell from its surroundings is nearly the same then. One that is too small or too thin for
    them is not: nothing ends where it does.

    Args:
        similarity: of the whole volume's cells.
        points_ras: the structure's positive points (N, 3), N ≥ 1.
    """
    found, more = (clicked_components(similarity, points_ras, share * similarity.iso).sum() for share in (1.0, LOWER))
    return bool(more >= MUCH_LARGER * found > 0)
