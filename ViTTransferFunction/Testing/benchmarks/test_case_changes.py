"""Scans made of others: what becomes of voxels, truth and geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from Benchmarks.shared import case_changes
from Benchmarks.shared.labelled_cases import LabelledVolume
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume


def with_array(labelled: LabelledVolume, array: np.ndarray) -> LabelledVolume:
    return replace(labelled, volume=replace(labelled.volume, array=array))


def where_ras(labelled: LabelledVolume, name: str) -> np.ndarray:
    """Centre of a structure."""
    kji = np.argwhere(labelled.truth == labelled.names.index(name) + 1).mean(axis=0)
    return labelled.volume.geometry.ijk_to_ras_points(kji[None, ::-1])[0]


def test_an_organ_fills_a_quarter_of_its_crop_and_is_whole(labelled: LabelledVolume) -> None:
    crop = case_changes.filled_by(labelled, ["left"])
    share = np.mean(crop.truth == crop.names.index("left") + 1)
    assert case_changes.FILLED_SHARE <= share < case_changes.FILLED_SHARE + 0.1
    assert (crop.truth == 1).sum() == (labelled.truth == 1).sum()
    np.testing.assert_allclose(where_ras(crop, "left"), where_ras(labelled, "left"))


def test_several_organs_may_fill_a_crop_together(labelled: LabelledVolume) -> None:
    crop = case_changes.filled_by(labelled, ["left", "right"])
    assert {"left", "right"} <= set(crop.names)
    assert np.isin(crop.truth, (1, 2)).sum() == np.isin(labelled.truth, (1, 2)).sum()


def test_a_crop_drops_structures_of_which_little_is_left(labelled: LabelledVolume) -> None:
    left = case_changes.cropped(labelled, (slice(0, 32), slice(0, 40), slice(0, 20)))
    assert left.names == ("left",)
    assert set(np.unique(left.truth)) == {0, 1}


def test_the_right_half_is_the_patients_right(labelled: LabelledVolume) -> None:
    assert where_ras(labelled, "right")[0] > where_ras(labelled, "left")[0]
    assert "right" in case_changes.right_half(labelled).names
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    geometry = Geometry(labelled.truth.shape, mirror @ labelled.volume.geometry.ijk_to_ras)
    mirrored = replace(labelled, volume=Volume(labelled.volume.array, geometry))
    assert "left" in case_changes.right_half(mirrored).names


def test_thick_slices_are_averages_and_everything_stays_where_it_is(labelled: LabelledVolume) -> None:
    thick = case_changes.thick_slices(labelled, 12.0)
    np.testing.assert_allclose(
        thick.volume.array, labelled.volume.array.reshape(8, 4, 40, 48).mean(axis=1), rtol=1e-4, atol=1e-3
    )
    np.testing.assert_allclose(thick.volume.geometry.extent_mm, labelled.volume.geometry.extent_mm)
    for name in labelled.names:
        np.testing.assert_allclose(where_ras(thick, name), where_ras(labelled, name), atol=3.0)


def test_slices_need_not_divide_evenly(labelled: LabelledVolume) -> None:
    k = np.broadcast_to(np.arange(32.0)[:, None, None], (32, 40, 48))
    thick = case_changes.thick_slices(with_array(labelled, k.copy()), 5.0)
    count = len(thick.truth)
    assert count == 19
    # A ramp's average over a part of it is its value in the middle of the part, but for the steps of voxels.
    expected = (np.arange(count) + 0.5) * 32 / count - 0.5
    np.testing.assert_allclose(thick.volume.array[:, 0, 0], expected, atol=0.25)


def test_at_half_resolution_a_voxel_is_what_most_of_it_is(labelled: LabelledVolume) -> None:
    half = case_changes.half_resolution(labelled)
    assert half.truth.shape == (32, 20, 24)
    np.testing.assert_allclose(half.spacing_mm, [3.0, 4.0, 4.0])
    for label in (1, 2, 3):
        share = (labelled.truth == label).reshape(32, 20, 2, 24, 2).mean(axis=(2, 4))
        assert (half.truth[share > 0.5] == label).all()
        assert not (half.truth[share < 0.25] == label).any()


def test_noise_is_estimated_and_doubled(labelled: LabelledVolume) -> None:
    one_structure = replace(labelled, truth=np.ones_like(labelled.truth), names=("body",))
    noisy = with_array(one_structure, np.random.default_rng(5).normal(40.0, 5.0, labelled.truth.shape))
    assert case_changes.noise(noisy) == pytest.approx(5.0, rel=0.02)
    assert case_changes.noise(case_changes.twice_the_noise(noisy)) == pytest.approx(10.0, rel=0.02)


def test_edges_hardly_count_as_noise(labelled: LabelledVolume) -> None:
    # conftest's spheres have noise of 5, and edges of 200.
    assert case_changes.noise(labelled) == pytest.approx(5.0, rel=0.2)


def test_a_soft_tissue_window_leaves_256_values(labelled: LabelledVolume) -> None:
    hounsfield = np.broadcast_to(np.linspace(-1000.0, 1000.0, 32)[:, None, None], labelled.truth.shape)
    array = case_changes.soft_tissue_only(with_array(labelled, hounsfield.copy())).volume.array
    assert (array.dtype, array.min(), array.max()) == (np.uint8, 0, 255)
    assert len(np.unique(array)) > 5


def test_only_some_structures_can_be_kept(labelled: LabelledVolume) -> None:
    some = labelled.only([3, 1])
    assert some.names == ("dark", "left")
    np.testing.assert_array_equal(some.truth == 1, labelled.truth == 3)
    np.testing.assert_array_equal(some.truth == 2, labelled.truth == 1)
