"""Points where a scan has no intensity."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.missing_intensity import without_intensity, without_intensity_text

GEOMETRY = Geometry((4, 5, 6), np.diag([2.0, 3.0, 4.0, 1.0]))


@pytest.mark.parametrize("nothing", [np.nan, np.inf, -np.inf])
def test_points_in_voxels_that_are_no_finite_number_are_counted(nothing: float) -> None:
    array = np.zeros(GEOMETRY.shape, dtype=np.float32)
    array[1, 2, 3] = nothing
    (middle,) = GEOMETRY.ijk_to_ras_points(np.array([[3.0, 2.0, 1.0]]))
    points = middle + np.array([[0.0, 0.0, 0.0], [0.9, 1.4, -1.9], [1.1, 0.0, 0.0], [0.0, 0.0, 2.1]])
    assert without_intensity(array, GEOMETRY, points) == 2
    assert without_intensity(array, GEOMETRY, points[2:]) == 0
    assert without_intensity(array, GEOMETRY, np.empty((0, 3))) == 0
    assert without_intensity(np.zeros(GEOMETRY.shape, dtype=np.int16), GEOMETRY, points) == 0


def test_one_point_and_several_are_told_in_one_sentence_each() -> None:
    assert without_intensity_text(1).startswith("1 point inside lies where the scan has no intensity")
    assert without_intensity_text(2).startswith("2 points inside lie where the scan has no intensity")
