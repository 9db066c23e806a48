"""Intensities as grey levels."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.rendering.intensity_levels import gray_levels, intensity_levels


@pytest.mark.parametrize("dtype", [np.int16, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(20, 20, 20), (60, 60, 60), (90, 90, 90)])
def test_the_volume_has_the_scans_intensities_as_grey_levels(dtype: type, shape: tuple[int, int, int]) -> None:
    intensities: np.ndarray = (np.arange(60) * np.ones((60, 60, 1))).astype(dtype)
    levels = gray_levels(intensities, np.linspace(10.0, 50.0, 256), shape)
    centres = (np.arange(shape[2]) + 0.5) * 60 / shape[2] - 0.5
    assert levels[5, 5] == pytest.approx(np.clip((centres - 10.0) / 40.0, 0.0, 1.0) * 255.0, abs=4.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_between_voxels_levels_are_interpolated_along_each_axis(axis: int) -> None:
    along = np.array([10.0, 50.0, 20.0])
    intensities = np.moveaxis(np.broadcast_to(along, (4, 4, 3)), 2, axis)
    shape: list[int] = [4, 4, 4]
    shape[axis] = 9
    levels = np.moveaxis(gray_levels(intensities, np.arange(256.0), (shape[0], shape[1], shape[2])), axis, 2)
    expected = np.rint(np.interp(np.arange(9), [1, 4, 7], along))
    np.testing.assert_array_equal(levels, np.broadcast_to(expected, (4, 4, 9)))


def test_what_is_frequent_gets_more_levels_and_all_is_covered() -> None:
    rng = np.random.default_rng(0)
    array = np.where(rng.random((40, 40, 40)) < 0.1, 3000.0 * rng.random((40, 40, 40)), rng.normal(60.0, 20.0, (40, 40, 40)))
    levels = intensity_levels(Volume(array, Geometry((40, 40, 40), np.eye(4)), "any"))
    assert (np.diff(levels) > 0.0).all()
    assert ((levels > 0.0) & (levels < 120.0)).sum() > 90
    assert (levels > 1500.0).sum() > 50


def test_what_is_no_number_is_dark() -> None:
    intensities = np.full((2, 2, 2), np.nan)
    assert (gray_levels(intensities, np.arange(-100.0, 156.0), (2, 2, 2)) == 0).all()


@pytest.mark.parametrize("shape", [(20, 18, 16), (13, 18, 11), (31, 40, 20)])
def test_a_part_has_the_levels_that_it_has_in_the_whole(shape: tuple[int, int, int]) -> None:
    intensities = np.random.default_rng(0).integers(-50, 300, (20, 18, 16)).astype(np.int16)
    part = (slice(2, 9), slice(0, 17), slice(5, 10))
    levels = np.arange(256.0)
    of_part, of_all = gray_levels(intensities, levels, shape, part), gray_levels(intensities, levels, shape)
    # Where they are interpolated, sums are not rounded alike.
    np.testing.assert_allclose(of_part.astype(int), of_all[part], atol=1 if shape > intensities.shape else 0)
