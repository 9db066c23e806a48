"""Numbers that somebody gave: in a file, or in a message."""

from __future__ import annotations

from typing import Any

import numpy as np

FARTHEST = 1e9
"""Of a coordinate, either way, in millimetres or voxels: beyond any scan, and far from what sums of squares can hold."""


def is_number(value: Any) -> bool:
    """Whether a value out of a file is a number, which true and false are not."""
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
