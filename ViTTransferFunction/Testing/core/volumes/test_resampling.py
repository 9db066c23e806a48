"""Labels on other grids, and samples of maps of which a part is at hand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Box, Geometry
from ViTTransferFunction.Logic.core.volumes.resampling import (
    FixedPlaces,
    corners_around,
    interpolated,
    resample_labels,
    sample_at,
)

LABELS = np.random.default_rng(0).integers(0, 5, (6, 7, 8)).astype(np.uint8)
SOURCE = np.diag([0.9, 1.3, 2.1, 1.0])


def nearest(labels: np.ndarray, geometry: Geometry, target: Geometry) -> np.ndarray:
    """The label at each voxel centre of the target, one by one."""
    kji = np.floor(geometry.ras_to_ijk(target.voxel_centres_ras())[:, ::-1] + 0.5).astype(int)
    inside = ((kji >= 0) & (kji < labels.shape)).all(axis=1)
    values = np.zeros(len(kji), dtype=labels.dtype)
    values[inside] = labels[tuple(kji[inside].T)]
    return values.reshape(target.shape)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, -1)])
def test_labels_on_parallel_axes_are_those_of_the_nearest_voxels(order: tuple[int, ...], signs: tuple[int, ...]) -> None:
    """In any order and direction, finer along one axis, coarser along another, and in part outside."""
    axes = np.zeros((3, 3))
    for column, (row, sign, spacing) in enumerate(zip(order, signs, (0.37, 1.71, 2.9), strict=True)):
        axes[row, column] = sign * spacing
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    matrix[:3, 3] = np.array([3.3, 4.1, 5.7]) - axes @ [4.6, 3.3, 2.2]
    source, target = Geometry(LABELS.shape, SOURCE), Geometry((5, 6, 9), matrix)
    expected = nearest(LABELS, source, target)
    assert expected.any()
    np.testing.assert_array_equal(resample_labels(LABELS, source, target), expected)


def test_labels_on_turned_axes_are_those_of_the_nearest_voxels() -> None:
    turn = np.eye(4)
    turn[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    source, target = Geometry(LABELS.shape, SOURCE), Geometry((6, 7, 8), turn @ SOURCE)
    expected = nearest(LABELS, source, target)
    assert expected.any()
    np.testing.assert_array_equal(resample_labels(LABELS, source, target), expected)


def test_a_grid_elsewhere_has_no_labels() -> None:
    elsewhere = SOURCE.copy()
    elsewhere[:3, 3] = 100.0
    target = Geometry((3, 3, 3), elsewhere @ np.diag([1.1, 1.1, 1.1, 1.0]))
    assert not resample_labels(LABELS, Geometry(LABELS.shape, SOURCE), target).any()


@pytest.mark.parametrize(
    "box", [(slice(0, 4), slice(0, 1), slice(0, 6)), (slice(1, 4), slice(0, 1), slice(2, 5)), (slice(0, 0),) * 3]
)
def test_places_that_are_kept_give_the_samples_of_each_map_also_beyond_the_border(box: Box) -> None:
    generator = np.random.default_rng(3)
    shape = (4, 1, 6)
    geometry = Geometry(shape, np.array([[0.0, -2.0, 0.0, 5.0], [1.5, 0.0, 0.0, 0.0], [0.0, 0.0, 3.0, -4.0], [0, 0, 0, 1.0]]))
    points = geometry.ijk_to_ras_points(generator.uniform(-2.0, 8.0, (200, 3)))
    elsewhere = generator.random(200, dtype=np.float32)
    places = FixedPlaces(geometry, points)
    for _ in range(2):
        values = generator.random(shape, dtype=np.float32)
        expected = sample_at(values[..., None], geometry, points)[:, 0]
        # What lies beyond the box may be anything: where it is looked at, the sample is the one from elsewhere.
        unknown = np.full(shape, np.nan, dtype=np.float32)
        unknown[box] = values[box]
        from_box = sum(np.isnan(unknown[tuple(index.T)]) for index, _ in corners_around(geometry, points)) == 0
        sampled = places.sample(values[box], box, elsewhere)
        np.testing.assert_array_equal(sampled, np.where(from_box, expected, elsewhere))
        assert from_box.any() == (values[box].size > 0)


def test_samples_of_what_changes_evenly_are_right_between_voxels_and_stay_what_they_are_at_the_border() -> None:
    geometry = Geometry(
        (4, 5, 6), np.array([[0.0, -2.0, 0.5, 5.0], [1.5, 0.0, 0.0, 0.0], [0.0, 0.3, 3.0, -4.0], [0, 0, 0, 1.0]])
    )
    kji = np.random.default_rng(4).uniform(-1.0, 6.0, (200, 3))
    values = (np.indices(geometry.shape) * np.array([100.0, 10.0, 1.0])[:, None, None, None]).sum(axis=0)
    expected = np.clip(kji, 0.0, np.array(geometry.shape) - 1) @ [100.0, 10.0, 1.0]
    sampled = sample_at(values[..., None], geometry, geometry.ijk_to_ras_points(kji[:, ::-1]))[:, 0]
    np.testing.assert_allclose(sampled, expected, rtol=1e-5, atol=1e-4)


def test_cubic_values_are_those_of_the_filter_of_mitchell_and_netravali() -> None:
    """Which leaves 8/9 of a single cell, gives 1/18 to those beside it, and keeps even changes."""
    line = np.zeros((1, 1, 9))
    line[..., 4] = 1.0
    along = (np.zeros(1), np.zeros(1), np.arange(9.0))
    expected = [0.0, 0.0, 0.0, 1 / 18, 8 / 9, 1 / 18, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(interpolated(line, along, cubic=True)[0, 0], expected, atol=1e-6)
    between = np.linspace(1.0, 7.0, 50)
    even = interpolated(np.arange(9.0).reshape(9, 1, 1), (between, np.zeros(1), np.zeros(1)), cubic=True)[:, 0, 0]
    np.testing.assert_allclose(even, between, atol=1e-5)
