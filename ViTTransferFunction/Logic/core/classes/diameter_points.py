"""Points that a diameter stands for: a line drawn across a structure, from where it begins to where it ends."""

from __future__ import annotations

import numpy as np

from ..system.errors import InputError

INSIDE = (0.5, 0.25, 0.75)
"""Places along the line, as shares of it: the middle first, which is the most typical of the structure."""
BEYOND = 0.2
"""How far beyond its ends the structure is surely over, as a share of the line: hands are not exact, nor are edges sharp."""
LEAST_BEYOND_MM = 2.0
"""But not less in a scan of a body: a voxel or two."""
SHORTEST_MM = 0.5
"""What is shorter was not drawn across anything in a scan of a body."""


def points_of_diameter(ends_ras: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Points inside a structure, along a line across it, and points outside, beyond both ends of the line.

    Args:
        ends_ras: (2, 3) RAS millimetres, on the structure's edge.
        scale: of lengths that are meant for bodies (`body_scale`).

    Returns:
        (3, 3) points inside and (2, 3) points outside, RAS millimetres, each in the order in which they count.

    Raises:
        InputError: the line is shorter than `SHORTEST_MM`, or, in a small scan, a part of it.
    """
    start, end = np.asarray(ends_ras, dtype=np.float64)
    length_mm = float(np.linalg.norm(end - start))
    if not length_mm >= scale * SHORTEST_MM:
        raise InputError(
            f"The diameter is {length_mm:.2g} mm long; at least {scale * SHORTEST_MM:.2g} mm were expected. Drag from one edge "
            "of the structure to the other, where it is longest."
        )
    inside = start + np.array(INSIDE)[:, None] * (end - start)
    beyond = max(BEYOND * length_mm, scale * LEAST_BEYOND_MM) / length_mm * (end - start)
    return inside, np.stack([start - beyond, end + beyond])
