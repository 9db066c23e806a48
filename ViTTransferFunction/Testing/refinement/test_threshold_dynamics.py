"""Where a surface moves by threshold dynamics: smooth, to the image's edges, and as marks say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.refinement import threshold_dynamics, workers
from ViTTransferFunction.Logic.refinement.threshold_dynamics import Mark, settled
from ViTTransferFunction.Testing.support.cancelling import cancel_at_call
from ViTTransferFunction.Testing.support.masks import ball_mask, box_mask, dice
from ViTTransferFunction.Testing.support.torch_threads import torch_threads
from ViTTransferFunction.Testing.support.volumes import volume_of

WINDOW = IntensityWindow(0.0, 200.0)
EDGE = 36


def ball(radius: float) -> np.ndarray:
    return ball_mask(EDGE, radius)


def scan_of(inside: np.ndarray, noise: float) -> np.ndarray:
    scan = np.where(inside, 120.0, 80.0) + np.random.default_rng(0).normal(0.0, noise, inside.shape)
    return scan.astype(np.float32)


def after(mask: np.ndarray, scan: np.ndarray, *marks: Mark) -> np.ndarray:
    """The settled mask, of all layers."""
    return np.concatenate(list(settled(mask, scan, WINDOW, marks)))


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(workers, "SHARED_VOXELS", 1)
    with torch_threads(2):
        yield


def test_what_noise_wrote_into_a_surface_goes() -> None:
    truth = ball(11.0)
    wrong = np.random.default_rng(1).random(truth.shape) < 0.25
    noisy = np.where(ball(13.0) & ~ball(9.0), truth ^ wrong, truth)
    smooth = after(noisy, scan_of(truth, 40.0))
    assert dice(noisy, truth) < 0.9
    assert dice(smooth, truth) > 0.97


def test_a_mask_that_ends_early_goes_on_to_the_edge_and_one_that_leaked_comes_back() -> None:
    truth = ball(11.0)
    scan = scan_of(truth, 20.0)
    for radius in (9.0, 13.0):
        assert dice(after(ball(radius), scan), truth) > dice(ball(radius), truth) + 0.05


def test_what_is_one_voxel_wide_stays_where_the_image_shows_it() -> None:
    line = box_mask((EDGE,) * 3, slice(17, 18), slice(17, 18), slice(4, 32))
    np.testing.assert_array_equal(after(line, scan_of(line, 2.0)), line)


@pytest.mark.parametrize("thickness", [1, 2])
def test_what_is_thin_does_not_vanish_where_the_image_hardly_shows_it(thickness: int) -> None:
    sheet = box_mask((EDGE,) * 3, slice(17, 17 + thickness), slice(9, 27), slice(6, 30))
    assert dice(after(sheet, scan_of(sheet, 20.0)), sheet) > 0.7


def test_a_flat_surface_stays_where_the_image_shows_nothing() -> None:
    half = box_mask((EDGE,) * 3, slice(0, 14), slice(None), slice(None))
    np.testing.assert_array_equal(after(half, np.full(half.shape, 7, dtype=np.int16)), half)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_voxels_without_a_finite_intensity_go_by_their_neighbourhood(value: float) -> None:
    truth = ball(11.0)
    scan = scan_of(truth, 5.0)
    scan[17:19, 12:24, 12:24] = value
    scan[0:3] = value
    np.testing.assert_array_equal(after(truth, scan), truth)
    np.testing.assert_array_equal(after(truth, np.full(scan.shape, value))[16:20, 14:22, 14:22], True)


def test_a_mark_has_its_voxel_and_what_lies_around_it_on_its_side() -> None:
    truth = ball(11.0)
    radii = 2.2, 2.2, 2.2
    outside, inside = Mark((17.3, 17.0, 26.0), radii, inside=False), Mark((17.0, 4.6, 17.0), radii, inside=True)
    marked = after(truth, scan_of(truth, 5.0), outside, inside)
    assert truth[17, 17, 24:28].all()
    assert not marked[17, 17, 24:28].any()
    assert not truth[17, 3:7, 17].any()
    assert marked[17, 3:7, 17].all()
    far = np.ones(truth.shape, dtype=bool)
    far[13:22, 13:22, 22:31] = far[13:22, 0:10, 13:22] = False
    np.testing.assert_array_equal(marked[far], after(truth, scan_of(truth, 5.0))[far])


def test_marks_where_there_is_nothing_and_marks_beyond_the_volume_do_no_harm() -> None:
    truth = ball(6.0)
    marks = [Mark(centre, (0.2, 0.2, 0.2), True) for centre in ((-3.0, 5.0, 5.0), (5.0, 90.0, 5.0), (2.0, 2.0, 2.4))]
    marked = after(truth, scan_of(truth, 5.0), *marks)
    assert np.argwhere(marked & ~ball(8.0)).tolist() == [[2, 2, 2]]


@pytest.mark.parametrize("voxels", [1, 5 * EDGE**2, EDGE**3])
def test_a_mark_between_two_voxels_is_of_the_one_that_holds_its_point(monkeypatch: pytest.MonkeyPatch, voxels: int) -> None:
    monkeypatch.setattr(threshold_dynamics, "_VOXELS_HELD", voxels)
    truth = ball(6.0)
    marks = [Mark((k, 2.5, 3.5), (0.2, 0.2, 0.2), True) for k in (2.5, 5.5, 8.5)]
    marked = after(truth, scan_of(truth, 5.0), *marks)
    places = np.array([mark.centre[::-1] for mark in marks])
    held = volume_of(truth.astype(np.uint8)).geometry.nearest_voxels(places)
    np.testing.assert_array_equal(np.argwhere(marked & ~ball(8.0)), held)


def test_the_mask_is_left_as_it_was_however_it_is_stored(two_threads: None) -> None:
    truth, scan = ball(11.0), scan_of(ball(11.0), 20.0)
    expected = after(ball(9.0), scan)
    mask = ball(9.0).copy(order="F")
    np.testing.assert_array_equal(after(mask, scan.copy(order="F")), expected)
    np.testing.assert_array_equal(mask, ball(9.0))
    np.testing.assert_array_equal(after(ball(9.0)[::-1], scan[::-1])[::-1], expected)
    assert dice(expected, truth) > 0.94


def test_it_can_be_cancelled_in_the_middle() -> None:
    with pytest.raises(Cancelled):
        list(settled(ball(9.0), scan_of(ball(11.0), 20.0), WINDOW, between=cancel_at_call(30)))


@pytest.mark.parametrize("voxels", [1, 5 * EDGE**2, 13 * EDGE**2])
@pytest.mark.parametrize("noise", [20.0, 60.0])
def test_in_how_many_parts_it_is_done_makes_no_difference(monkeypatch: pytest.MonkeyPatch, voxels: int, noise: float) -> None:
    sheet = box_mask((EDGE,) * 3, slice(3, 33), slice(17, 19), slice(6, 30))
    marks = [Mark((17.0, 4.6, 17.0), (3.0, 3.0, 3.0), True), Mark((20.2, 18.0, 12.0), (2.2, 2.2, 2.2), False)]
    for mask in (ball(9.0), sheet):
        monkeypatch.undo()
        expected = after(mask, scan_of(ball(11.0) | sheet, noise), *marks)
        monkeypatch.setattr(threshold_dynamics, "_VOXELS_HELD", voxels)
        np.testing.assert_array_equal(after(mask, scan_of(ball(11.0) | sheet, noise), *marks), expected)
