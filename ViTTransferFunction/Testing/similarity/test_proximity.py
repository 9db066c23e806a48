"""Maps that fade with distance."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.similarity.proximity import proximity

GEOMETRY = Geometry((4, 5, 6), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))


def at_cells(*ijk: tuple[int, int, int]) -> np.ndarray:
    return GEOMETRY.ijk_to_ras_points(np.array(ijk))


def test_proximity_is_measured_in_millimetres_along_oblique_anisotropic_axes() -> None:
    points = at_cells((1, 2, 3))
    weights = proximity(GEOMETRY, points, 0.5)
    ijk = np.array([[4, 0, 1]])
    distance = np.linalg.norm(GEOMETRY.ijk_to_ras_points(ijk) - points)
    assert weights[1, 0, 4] == pytest.approx(np.exp(-10 * 0.5 * distance / GEOMETRY.extent_mm.max()), rel=1e-5)
    assert weights[3, 2, 1] == pytest.approx(1.0)


def test_proximity_goes_by_the_nearest_point() -> None:
    first, second = at_cells((0, 0, 0)), at_cells((5, 4, 3))
    both = proximity(GEOMETRY, np.concatenate([first, second]), 0.7)
    np.testing.assert_allclose(both, np.maximum(proximity(GEOMETRY, first, 0.7), proximity(GEOMETRY, second, 0.7)))
