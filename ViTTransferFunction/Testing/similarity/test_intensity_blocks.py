"""Intensities in blocks, and their means in cells."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.similarity.intensity_blocks import IntensityBlocks, block_means
from ViTTransferFunction.Testing.support.volumes import volume_of

WINDOW = IntensityWindow(-160.0, 240.0)


@pytest.mark.parametrize("shape", [(1, 20, 20), (5, 7, 3), (40, 9, 33)])
def test_blocks_hold_the_mean_of_their_voxels_whatever_their_number(shape: tuple[int, int, int]) -> None:
    array = np.full(shape, 7, dtype=np.int16)
    means = block_means(array, (8, 8, 8))
    np.testing.assert_array_equal(means, np.full((8, 8, 8), 7.0, dtype=np.float32))


def test_the_mean_of_a_block_passes_over_what_is_not_finite() -> None:
    array = np.arange(64.0).reshape(4, 4, 4)
    array[0, 0, 0], array[2:, 2:, 2:] = np.inf, np.nan
    means = block_means(array, (2, 2, 2))
    assert means[0, 0, 0] == pytest.approx(np.mean([1, 4, 5, 16, 17, 20, 21]))
    assert np.isnan(means[1, 1, 1])
    assert np.isfinite(means.ravel()[:-1]).all()


@pytest.mark.parametrize("shape", [(9, 12, 10), (4, 7, 30)])
def test_a_hole_changes_the_mean_of_its_own_block_alone(shape: tuple[int, int, int]) -> None:
    array = np.random.default_rng(0).normal(0.0, 100.0, shape).astype(np.float32)
    whole = block_means(array, (4, 4, 4)).ravel()
    array[0, 0, 0] = np.nan
    holed = block_means(array, (4, 4, 4)).ravel()
    assert holed[0] != whole[0]
    np.testing.assert_array_equal(holed[1:], whole[1:])


def test_a_cell_has_the_mean_of_those_of_its_blocks_that_are_known() -> None:
    array = np.random.default_rng(0).normal(40.0, 100.0, (4, 6, 8)).astype(np.float32)
    array[0, :, 0] = array[2:, 4:, 6:] = np.nan
    volume = volume_of(array)
    units = (array - 40.0) * np.float32(1024 / 400)
    in_cells = np.rint(units).reshape(2, 2, 3, 2, 4, 2)
    known = np.isfinite(in_cells)
    expected = np.rint(np.where(known, in_cells, 0.0).sum(axis=(1, 3, 5)) / np.maximum(known.sum(axis=(1, 3, 5)), 1))
    found = IntensityBlocks(volume, volume.geometry.resized((2, 3, 4)), WINDOW).cell_units()
    np.testing.assert_array_equal(found[known.any(axis=(1, 3, 5))], expected[known.any(axis=(1, 3, 5))])
    assert found[1, 2, 3] > 10_000


def test_cells_have_the_mean_of_their_blocks() -> None:
    volume = volume_of(np.random.default_rng(0).normal(40.0, 100.0, (32, 32, 32)).astype(np.float32))
    fine, coarse = (IntensityBlocks(volume, volume.geometry.resized((8, 8, 8)), WINDOW, per_cell) for per_cell in (2, 1))
    np.testing.assert_allclose(fine.cell_units(), coarse.cell_units(), atol=1)


def test_means_of_cells_are_those_of_their_voxels_and_unknown_where_no_voxel_is_a_number() -> None:
    volume = volume_of(np.random.default_rng(0).normal(40.0, 100.0, (32, 32, 32)).astype(np.float32))
    volume.array[:, :, :2] = np.nan
    means = IntensityBlocks(volume, volume.geometry.resized((16, 16, 16)), IntensityWindow(0.0, 100.0)).cell_means()
    expected = volume.array.reshape(16, 2, 16, 2, 16, 2).mean(axis=(1, 3, 5))
    np.testing.assert_allclose(means, expected, atol=0.1)
