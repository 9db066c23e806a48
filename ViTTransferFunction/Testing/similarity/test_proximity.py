"""Maps that fade with distance."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.similarity.proximity import proximity
from ViTTransferFunction.Testing.support.turned_cells import TURNED_CELLS, at_turned_cells

LONGEST_MM = float(TURNED_CELLS.extent_mm.max())


def test_proximity_is_measured_in_millimetres_along_oblique_anisotropic_axes() -> None:
    points = at_turned_cells((1, 2, 3))
    weights = proximity(TURNED_CELLS, points, 0.5, LONGEST_MM)
    ijk = np.array([[4, 0, 1]])
    distance = np.linalg.norm(TURNED_CELLS.ijk_to_ras_points(ijk) - points)
    assert weights[1, 0, 4] == pytest.approx(np.exp(-10 * 0.5 * distance / TURNED_CELLS.extent_mm.max()), rel=1e-5)
    assert weights[3, 2, 1] == pytest.approx(1.0)


def test_proximity_goes_by_the_nearest_point() -> None:
    first, second = at_turned_cells((0, 0, 0)), at_turned_cells((5, 4, 3))
    both = proximity(TURNED_CELLS, np.concatenate([first, second]), 0.7, LONGEST_MM)
    np.testing.assert_allclose(
        both, np.maximum(proximity(TURNED_CELLS, first, 0.7, LONGEST_MM), proximity(TURNED_CELLS, second, 0.7, LONGEST_MM))
    )
