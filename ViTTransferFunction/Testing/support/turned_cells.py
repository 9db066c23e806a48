"""A small grid of cells whose axes differ in length and are not in the order of the patient's."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

TURNED_CELLS = Geometry((4, 5, 6), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))
"""I runs anterior, J left, K superior; cells of 3×2×4 mm."""


def at_turned_cells(*ijk: tuple[int, int, int]) -> np.ndarray:
    """The centres of cells, (N, 3) RAS millimetres."""
    return TURNED_CELLS.ijk_to_ras_points(np.array(ijk))
