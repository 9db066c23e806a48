"""Reading the feature volume at points, and making it comparable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation
from ViTTransferFunction.Logic.core.volumes.resampling import sample_at
from ViTTransferFunction.Logic.features import whitening
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.whitening import (
    Statistics,
    normalised_features,
    normalised_size_bytes,
    unit_vectors,
)
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

OBLIQUE = np.array([[0.0, -2.0, 0.3, 5.0], [3.0, 0.0, 0.0, -7.0], [0.0, 0.2, 4.0, 1.0], [0.0, 0.0, 0.0, 1.0]])


def feature_volume(array: np.ndarray) -> FeatureVolume:
    return FeatureVolume(array, Geometry(array.shape[:3], OBLIQUE), "key")


def test_samples_are_trilinear() -> None:
    values = np.random.default_rng(0).random((5, 6, 7, 2))
    geometry = Geometry((5, 6, 7), OBLIQUE)
    ijk = np.random.default_rng(1).uniform(0, [6, 5, 4], (20, 3))
    expected = [ndimage.map_coordinates(values[..., c], ijk[:, ::-1].T, order=1) for c in range(2)]
    np.testing.assert_allclose(sample_at(values, geometry, geometry.ijk_to_ras_points(ijk)), np.array(expected).T, rtol=1e-5)


def test_samples_beyond_the_outermost_cell_centres_are_those_of_the_nearest() -> None:
    values = np.random.default_rng(0).random((3, 3, 3, 1))
    geometry = Geometry((3, 3, 3), np.eye(4))
    outside = np.array([[-0.5, -0.5, -0.5], [2.5, 2.5, 2.5]])
    np.testing.assert_allclose(sample_at(values, geometry, outside)[:, 0], [values[0, 0, 0, 0], values[2, 2, 2, 0]], rtol=1e-6)


def test_a_grid_of_a_single_layer_can_be_sampled() -> None:
    values = np.arange(6.0).reshape(1, 2, 3, 1)
    assert sample_at(values, Geometry((1, 2, 3), np.eye(4)), np.array([[0.5, 0.5, 0.0]]))[0, 0] == pytest.approx(2.0)


@pytest.mark.parametrize("stored", [Orientation((0, 1, 2), (True, False, True)), Orientation((2, 0, 1), (False, True, False))])
def test_the_same_patches_tell_how_features_vary_however_a_scan_is_stored(
    stored: Orientation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where there are many patches, as in the preset *fine*, some of them do."""
    monkeypatch.setattr(whitening, "STATISTICS_PATCHES", 300)
    scan = volume_of(np.random.default_rng(0).random((13, 10, 12)))
    vectors = np.random.default_rng(1).normal(size=(*scan.shape, 4)).astype(np.float32)
    turned = stored_as(scan, stored)
    expected = normalised_features(FeatureVolume(vectors, scan.geometry, "key"), "centred").source.moments
    found = normalised_features(
        FeatureVolume(np.ascontiguousarray(stored.to_canonical(vectors)), turned.geometry, "key"), "centred"
    ).source.moments
    assert expected is not None
    assert found is not None
    np.testing.assert_allclose(found.mean, expected.mean, atol=1e-6)
    np.testing.assert_allclose(found.covariance, expected.covariance, atol=1e-6)


def test_whitened_features_have_no_mean_and_equal_uncorrelated_directions() -> None:
    generator = np.random.default_rng(0)
    mixing = generator.normal(size=(8, 8))
    array = (generator.normal(size=(9, 10, 11, 8)) @ mixing + 5.0).astype(np.float32)
    features = normalised_features(feature_volume(array), "whitened")
    whitened = features.transform.apply(array).reshape(-1, 8)
    np.testing.assert_allclose(whitened.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(np.cov(whitened.T), np.eye(8), atol=0.01)


@pytest.mark.parametrize("statistics", ["centred", "whitened"])
def test_moments_that_are_known_are_not_found_out_again(statistics: Statistics) -> None:
    array = np.random.default_rng(0).normal(size=(5, 6, 7, 4)).astype(np.float32)
    first = normalised_features(feature_volume(array), statistics)
    again = normalised_features(first.source, statistics)
    assert again.source.moments is first.source.moments is not None
    np.testing.assert_array_equal(again.array, first.array)
    elsewhere = replace(first.source, moments=replace(first.source.moments, mean=first.source.moments.mean + 1.0))
    np.testing.assert_allclose(normalised_features(elsewhere, statistics).transform.mean, first.transform.mean + 1.0, rtol=1e-6)


@pytest.mark.filterwarnings("error")
def test_features_that_cannot_be_written_to_are_whitened_as_others_are() -> None:
    patches = feature_volume(np.random.default_rng(0).normal(size=(4, 6, 5, 3)).astype(np.float16))
    expected = normalised_features(patches, "whitened").array
    patches.array.setflags(write=False)
    np.testing.assert_array_equal(normalised_features(patches, "whitened").array, expected)


def test_cells_between_patches_have_the_vectors_that_a_point_there_has() -> None:
    patches = feature_volume(np.random.default_rng(0).normal(size=(4, 6, 5, 3)).astype(np.float16))
    finer = patches.geometry.resized((9, 11, 13))
    features = normalised_features(replace(patches, compared_on=finer), "whitened")
    assert features.array.shape[:3] == features.geometry.shape == finer.shape
    np.testing.assert_allclose(
        features.array.reshape(-1, features.array.shape[-1]), features.at(finer.voxel_centres_ras()), atol=1e-3
    )


def test_a_channel_of_all_cells_lies_in_one_stretch_of_memory() -> None:
    array = np.random.default_rng(0).normal(size=(4, 5, 6, 8)).astype(np.float16)
    by_cells = normalised_features(feature_volume(array), "none").array
    by_channels = by_cells.reshape(-1, 8).T
    assert by_channels[3].flags.c_contiguous
    assert np.shares_memory(by_channels, by_cells)


@pytest.mark.parametrize("statistics", ["none", "centred", "whitened"])
def test_how_large_normalised_features_become_is_known_before(statistics: Statistics) -> None:
    features = feature_volume(np.random.default_rng(0).normal(size=(20, 18, 16, 80)).astype(np.float16))
    said = normalised_size_bytes(features.cells, features.channels, statistics)
    assert said == normalised_features(features, statistics).array.nbytes


def test_directions_that_do_not_vary_are_dropped() -> None:
    array = np.random.default_rng(0).normal(size=(6, 6, 6, 4)).astype(np.float32)
    array[..., 2] = 7.0
    features = normalised_features(feature_volume(array), "whitened")
    assert features.array.shape[-1] == 3
    assert np.isfinite(features.array).all()


@pytest.mark.parametrize("statistics", ["none", "centred", "whitened"])
def test_comparable_features_are_unit_vectors_also_at_points(statistics: str) -> None:
    array = np.random.default_rng(0).normal(2.0, 1.0, (4, 5, 6, 8)).astype(np.float16)
    features = normalised_features(feature_volume(array), statistics)  # type: ignore[arg-type]
    np.testing.assert_allclose(np.linalg.norm(features.array, axis=-1), 1.0, rtol=1e-4)
    centre_of_a_cell = features.geometry.ijk_to_ras_points(np.array([[3, 2, 1]]))
    np.testing.assert_allclose(features.at(centre_of_a_cell)[0], features.array[1, 2, 3], atol=1e-3)


def test_features_without_statistics_keep_their_direction() -> None:
    array = np.random.default_rng(0).normal(2.0, 1.0, (3, 3, 3, 8)).astype(np.float32)
    np.testing.assert_allclose(normalised_features(feature_volume(array), "none").array, unit_vectors(array), atol=1e-6)


def test_zero_vectors_stay_zero() -> None:
    np.testing.assert_array_equal(unit_vectors(np.zeros((2, 3))), np.zeros((2, 3)))


def test_features_that_are_the_same_everywhere_are_refused() -> None:
    with pytest.raises(InputError, match="same everywhere"):
        normalised_features(feature_volume(np.ones((2, 3, 4, 5), np.float32)), "whitened")


def test_features_that_are_not_finite_are_refused() -> None:
    array = np.random.default_rng(0).random((2, 3, 4, 5)).astype(np.float32)
    array[0, 0, 0] = np.inf
    with pytest.raises(InputError, match="not numbers"), np.errstate(all="ignore"):
        normalised_features(feature_volume(array), "whitened")
