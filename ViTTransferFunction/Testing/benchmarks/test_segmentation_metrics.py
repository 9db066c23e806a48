"""Metrics against answers known by counting."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from Benchmarks.shared.segmentation_metrics import segmentation_metrics, surface_dice, surface_distances_mm
from ViTTransferFunction.Testing.support.masks import box_mask

CUBE_MM = (1.0, 1.0, 1.0)

a_box = functools.partial(box_mask, (12, 12, 12))


def test_overlap_is_counted_in_voxels():
    truth = a_box(slice(2, 6), slice(2, 6), slice(2, 6))
    predicted = a_box(slice(2, 6), slice(2, 6), slice(4, 6))
    metrics = segmentation_metrics(predicted, truth, CUBE_MM)
    assert metrics.dice == pytest.approx(2 * 32 / (32 + 64))
    assert metrics.iou == pytest.approx(0.5)
    assert metrics.precision == 1.0
    assert metrics.recall == pytest.approx(0.5)


def test_a_perfect_prediction_scores_one():
    truth = a_box(slice(2, 6), slice(3, 9), slice(0, 12))
    metrics = segmentation_metrics(truth, truth, CUBE_MM)
    assert vars(metrics) == dict.fromkeys(vars(metrics), 1.0)


def test_nothing_predicted_where_nothing_is_scores_one():
    nothing = np.zeros((4, 4, 4), dtype=bool)
    metrics = segmentation_metrics(nothing, nothing, CUBE_MM)
    assert vars(metrics) == dict.fromkeys(vars(metrics), 1.0)


@pytest.mark.parametrize("swapped", [False, True])
def test_one_empty_mask_scores_zero(swapped):
    nothing, something = np.zeros((12, 12, 12), dtype=bool), a_box(slice(2, 6), slice(2, 6), slice(2, 6))
    predicted, truth = (something, nothing) if swapped else (nothing, something)
    metrics = segmentation_metrics(predicted, truth, CUBE_MM)
    assert vars(metrics) == dict.fromkeys(vars(metrics), 0.0)


def test_surfaces_as_far_apart_as_the_tolerance_agree():
    truth = a_box(slice(0, 12), slice(0, 12), slice(0, 5))
    predicted = a_box(slice(0, 12), slice(0, 12), slice(0, 7))
    assert surface_dice(predicted, truth, CUBE_MM, tolerance_mm=2.0) == 1.0


def test_area_beyond_the_tolerance_is_counted_on_both_surfaces():
    # Slabs across the whole volume, 1 and 11 voxels thick, have 2 × 144 + 4 × 12 × thickness faces. One side and the rim of
    # the thin one are common; within half a voxel nothing else is.
    thin = a_box(slice(0, 12), slice(0, 12), slice(0, 1))
    thick = a_box(slice(0, 12), slice(0, 12), slice(0, 11))
    common = 144 + 48
    expected = 2 * common / ((288 + 48) + (288 + 528))
    assert surface_dice(thick, thin, CUBE_MM, tolerance_mm=0.5) == pytest.approx(expected)


def test_surface_distance_is_measured_in_millimetres():
    truth = a_box(slice(2, 8), slice(2, 8), slice(2, 8))
    shifted = a_box(slice(3, 9), slice(2, 8), slice(2, 8))
    thick_slices_mm, thin_slices_mm = (5.0, 1.0, 1.0), (1.0, 1.0, 1.0)
    assert surface_dice(shifted, truth, thin_slices_mm) == 1.0
    assert surface_dice(shifted, truth, thick_slices_mm) < 1.0


def test_faces_count_by_their_area():
    # A bar that is one voxel of 10 mm longer has the same sides but for the new voxel's. Sides have 10 mm² a voxel, ends 1 mm².
    truth = a_box(slice(2, 6), slice(5, 6), slice(5, 6))
    longer = a_box(slice(2, 7), slice(5, 6), slice(5, 6))
    bar_mm = (10.0, 1.0, 1.0)
    sides, ends = 4 * 10.0, 1.0
    expected = (2 * 4 * sides + 2 * ends) / ((4 + 5) * sides + 4 * ends)
    assert surface_dice(longer, truth, bar_mm, tolerance_mm=0.5) == pytest.approx(expected)


def test_masks_of_different_shapes_are_refused():
    with pytest.raises(ValueError, match="shape"):
        segmentation_metrics(np.zeros((2, 2, 2), dtype=bool), np.zeros((2, 2, 3), dtype=bool), CUBE_MM)


def test_surface_distances_are_taken_from_both_sides():
    # A box and one that is 2 voxels of 2 mm longer: its end is 4 mm away, in one direction alone.
    short = a_box(slice(3, 8), slice(3, 8), slice(2, 6))
    long = a_box(slice(3, 8), slice(3, 8), slice(2, 8))
    distances = surface_distances_mm(long, short, (1.0, 1.0, 2.0))
    assert distances.max() == 4.0
    assert np.count_nonzero(distances == 0.0) == 2 * (25 + 4 * 5 * 4)
    np.testing.assert_array_equal(np.sort(distances), np.sort(surface_distances_mm(short, long, (1.0, 1.0, 2.0))))


def test_empty_parts_of_the_volume_do_not_change_the_surface_dice():
    truth = a_box(slice(4, 8), slice(4, 8), slice(4, 8))
    predicted = a_box(slice(4, 8), slice(4, 8), slice(4, 11))
    inner = (slice(3, 9), slice(3, 9), slice(3, 12))
    whole = surface_dice(predicted, truth, CUBE_MM, tolerance_mm=1.0)
    assert 0.0 < whole < 1.0
    assert surface_dice(predicted[inner], truth[inner], CUBE_MM, tolerance_mm=1.0) == whole
