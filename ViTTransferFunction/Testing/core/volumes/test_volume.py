"""What can be a volume, and what is made of its numbers."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume, finite_range

RISING = np.arange(60.0).reshape(3, 4, 5)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (RISING[0], r"has 2 array dimensions \(4, 5\); expected a scalar 3D volume"),
        (RISING.astype(complex), "holds complex128 values; expected real numbers"),
        (RISING > 3.0, "holds bool values; expected real numbers"),
        (RISING[:1], "is 5×4×1 voxels; expected at least 2 along every axis. A single slice is not a volume"),
        (RISING * np.nan, "holds no finite voxel"),
        (np.where(RISING > 3.0, np.inf, np.nan), "holds no finite voxel"),
        (np.where(RISING > 3.0, 7.0, np.inf), "is constant: every finite voxel is 7"),
        (np.full((3, 4, 5), -2, dtype=np.int16), "is constant: every finite voxel is -2"),
        (-1e300 * RISING, "cannot be told apart or held in single precision"),
        (1e9 + RISING / 60.0, "cannot be told apart or held in single precision"),
        (1e-40 * RISING, "cannot be told apart or held in single precision"),
    ],
)
def test_what_nothing_can_be_told_apart_in_is_no_volume(array: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=f"'CT' .*{message}"):
        Volume(array, Geometry((3, 4, 5) if array.ndim < 3 else array.shape, np.eye(4)), "CT")


@pytest.mark.parametrize("spacing_mm", [1.0, 0.01])
@pytest.mark.parametrize(("voxels_away", "refused"), [(-1.9e6, False), (2.1e6, True), (-1e8, True)])
def test_how_far_away_a_volume_may_lie_depends_on_its_voxels(spacing_mm: float, voxels_away: float, refused: bool) -> None:
    matrix = np.diag([spacing_mm, 2.0 * spacing_mm, spacing_mm, 1.0])
    matrix[1, 3] = spacing_mm * voxels_away
    with pytest.raises(InputError, match=r"'CT' lies .* Center Volume") if refused else nullcontext():
        Volume(RISING, Geometry(RISING.shape, matrix), "CT")


def test_voxels_and_geometry_are_of_one_shape() -> None:
    with pytest.raises(ValueError, match="differ"):
        Volume(RISING, Geometry((5, 4, 3), np.eye(4)))


@pytest.mark.parametrize(
    ("stored", "computed"),
    [
        (np.float16, np.float32),
        (np.longdouble, np.float64),
        (">f4", np.float32),
        (">i2", np.int16),
        (np.uint8, np.uint8),
        (np.float64, np.float64),
    ],
)
def test_numbers_that_cannot_be_computed_with_everywhere_are_converted(stored: str | type, computed: type) -> None:
    volume = Volume(RISING.astype(stored), Geometry(RISING.shape, np.eye(4)))
    assert volume.array.dtype == computed
    assert volume.array.dtype.isnative
    np.testing.assert_array_equal(volume.array, RISING)


def test_the_range_is_that_of_what_is_finite() -> None:
    array = RISING.copy()
    array.flat[[0, 30, 59]] = np.nan, np.inf, -np.inf
    assert finite_range(array) == (1.0, 58.0)
