"""How much of each voxel's neighbourhood is inside a mask, found at once and brought up to date."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy import ndimage

from ViTTransferFunction.Logic.refinement import neighbourhood_sums as module
from ViTTransferFunction.Logic.refinement.neighbourhood_sums import WEIGHTS, WHOLE, neighbourhood_sums, updated_sums
from ViTTransferFunction.Logic.refinement.workers import Workers

RNG = np.random.default_rng(0)
SHAPES = [(20, 30, 25), (1, 40, 7), (9, 1, 30), (2, 2, 3), (1, 1, 1)]


def sums_of(mask: np.ndarray) -> np.ndarray:
    with Workers(torch.device("cpu"), mask.size) as workers:
        sums: np.ndarray = neighbourhood_sums(torch.from_numpy(mask).view(torch.uint8), workers).numpy()
    return sums


def expected_sums(mask: np.ndarray) -> np.ndarray:
    sums = mask.astype(np.int16)
    for axis in range(3):
        sums = ndimage.correlate1d(sums, WEIGHTS, axis, mode="nearest")
    return sums


@pytest.mark.parametrize("shape", SHAPES)
def test_sums_are_those_of_a_binomial_along_each_axis(shape: tuple[int, int, int]) -> None:
    mask = RNG.random(shape) < 0.5
    np.testing.assert_array_equal(sums_of(mask), expected_sums(mask))
    np.testing.assert_array_equal(sums_of(np.ones(shape, dtype=bool)), WHOLE)


@pytest.mark.parametrize("at_once", [1, 7, 2**12])
@pytest.mark.parametrize("voxels_per_change", [0, 10**6])
@pytest.mark.parametrize("shape", SHAPES)
def test_sums_after_changes_are_those_of_the_changed_mask(
    monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int, int], voxels_per_change: int, at_once: int
) -> None:
    monkeypatch.setattr(module, "_VOXELS_PER_CHANGE", voxels_per_change)
    monkeypatch.setattr(module, "_CHANGES_AT_ONCE", at_once)
    before = RNG.random(shape) < 0.5
    # At the faces as well, where a voxel counts for those beyond them.
    mask = before ^ (RNG.random(shape) < 0.2)
    changed = np.flatnonzero(mask != before)
    with Workers(torch.device("cpu"), mask.size) as workers:
        sums = updated_sums(torch.from_numpy(sums_of(before)), torch.from_numpy(mask).view(torch.uint8), changed, workers)
    np.testing.assert_array_equal(sums.numpy(), expected_sums(mask))
