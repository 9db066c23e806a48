"""Boxes of maps."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.session.map_crop import crop_map, on_common_box, restricted


@pytest.fixture
def ramp() -> np.ndarray:
    """A cone of similarity around voxel (10, 8, 6) of a volume of (20, 16, 12)."""
    k, j, i = np.indices((20, 16, 12))
    return np.clip(1.0 - np.sqrt((k - 10) ** 2 + (j - 8) ** 2 + (i - 6) ** 2) / 8.0, 0.0, 1.0).astype(np.float32)


def test_a_crop_holds_all_of_the_map_that_matters(ramp: np.ndarray) -> None:
    crop = crop_map(ramp, 0.5)
    whole = np.zeros_like(ramp)
    whole[crop.box] = crop.array / 255.0
    np.testing.assert_allclose(whole[ramp >= 0.25], ramp[ramp >= 0.25], atol=0.5 / 255.0)
    assert crop.array.size < ramp.size


def test_a_map_of_nothing_still_has_a_box() -> None:
    crop = crop_map(np.zeros((5, 6, 7), dtype=np.float32), 0.5)
    assert min(crop.array.shape) >= 2
    assert crop.array.max() == 0


def test_a_restricted_crop_encloses_just_the_labelled_voxels(ramp: np.ndarray) -> None:
    crop = crop_map(ramp, 0.5)
    labels = np.where(ramp >= 0.5, 2, 0).astype(np.uint16)
    labels[:, :, 6:] = 1
    inside = restricted(crop, labels, 2).array / 255.0 >= crop.iso
    np.testing.assert_array_equal(inside, (labels == 2)[crop.box])


def test_crops_meet_on_the_box_that_holds_them_all(ramp: np.ndarray) -> None:
    other = np.roll(ramp, -6, axis=0)
    crops = [crop_map(ramp, 0.6), crop_map(other, 0.6)]
    arrays, box = on_common_box(crops)
    for array, similarity in zip(arrays, (ramp, other), strict=True):
        near = similarity[box] >= 0.3
        np.testing.assert_allclose(array[near] / 255.0, similarity[box][near], atol=0.5 / 255.0)
