"""Where surfaces move at strong edges: halfway between what lies on both sides, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.bounding_box import whole_box
from ViTTransferFunction.Logic.core.volumes.geometry import Box, Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.refinement import half_height
from ViTTransferFunction.Logic.refinement.half_height import BlockGrid, at_half_height
from ViTTransferFunction.Logic.refinement.neighbourhood_sums import WHOLE
from ViTTransferFunction.Logic.refinement.threshold_dynamics import Mark
from ViTTransferFunction.Testing.support.cancelling import cancel_at_call
from ViTTransferFunction.Testing.support.masks import ball_mask, box_mask, dice

SOFT_TISSUE = IntensityWindow(-160.0, 240.0)
LUNG, FAT, TISSUE = -850.0, -100.0, 50.0
EDGE = 40
WHOLE_BOX = whole_box((EDGE, EDGE, EDGE))
CUBES = np.array([0.7, 0.7, 0.7])


def ball(radius: float) -> np.ndarray:
    return ball_mask(EDGE, radius)


def blocks_of(spacing_mm: np.ndarray, box: Box) -> BlockGrid:
    """The blocks of a volume whose axes are those of the patient, or, where the spacing is negative, against them."""
    return BlockGrid.of(Geometry((EDGE, EDGE, EDGE), np.diag([*spacing_mm[::-1], 1.0])), box)


def scan_of(inside: np.ndarray, high: float = TISSUE, low: float = LUNG, noise: float = 20.0, blur: float = 1.2) -> np.ndarray:
    """A scan whose edges are blurred, by so many voxels."""
    blurred = ndimage.gaussian_filter(np.where(inside, high, low), blur)
    return np.rint(blurred + np.random.default_rng(0).normal(0.0, noise, inside.shape)).astype(np.int16)


def after(mask: np.ndarray, scan: np.ndarray, *marks: Mark, spacing_mm: np.ndarray = CUBES, box: Box = WHOLE_BOX) -> np.ndarray:
    return together(mask, scan, *marks, spacing_mm=spacing_mm, box=box)[0]


def together(
    mask: np.ndarray, scan: np.ndarray, *marks: Mark, spacing_mm: np.ndarray = CUBES, box: Box = WHOLE_BOX
) -> tuple[np.ndarray, np.ndarray]:
    """The mask and its sums, of all layers."""
    layers, masks, sums = zip(*at_half_height(mask, scan, blocks_of(spacing_mm, box), SOFT_TISSUE, marks), strict=True)
    assert [n for some in layers for n in range(some.start, some.stop)] == list(range(len(mask)))
    return np.concatenate(masks), np.concatenate(sums)


@pytest.mark.parametrize(("inside", "outside"), [(TISSUE, LUNG), (LUNG, TISSUE), (-1000.0, 0.0), (900.0, TISSUE)])
@pytest.mark.parametrize("radius", [8.6, 11.4])
def test_a_surface_beside_a_strong_edge_moves_halfway_up(inside: float, outside: float, radius: float) -> None:
    truth = ball(10.0)
    scan = scan_of(truth, inside, outside)
    assert dice(ball(radius), truth) < 0.82
    assert dice(after(ball(radius), scan), truth) > 0.97


@pytest.mark.parametrize("spacing", [(0.3, 0.3, 0.3), (1.0, 1.0, 1.0), (2.5, 0.7, 0.7), (5.0, 0.6, 0.6), (3.0, 3.0, 3.0)])
def test_it_does_so_in_voxels_of_any_shape(spacing: tuple[float, float, float]) -> None:
    truth = ball(10.0)
    scan = scan_of(truth, blur=0.7)
    assert dice(ball(9.4), truth) < 0.91
    assert dice(after(ball(9.4), scan, spacing_mm=np.array(spacing)), truth) > 0.97


def test_a_small_structure_gets_back_what_it_lost() -> None:
    truth = ball(5.0)
    assert dice(ball(3.6), truth) < 0.6
    assert dice(after(ball(3.6), scan_of(truth)), truth) > 0.85


def test_a_surface_stays_where_the_edge_is_not_strong() -> None:
    for low in (FAT, -300.0):
        np.testing.assert_array_equal(after(ball(8.6), scan_of(ball(10.0), low=low)), ball(8.6))


def test_a_surface_stays_where_other_tissue_lies_between_the_sides() -> None:
    organ, with_fat = ball(10.0), ball(14.0)
    scan = scan_of(with_fat, noise=0.0)
    scan[ndimage.binary_erosion(with_fat) & ~organ] = FAT
    np.testing.assert_array_equal(after(organ, scan), organ)
    # It would move into the same intensities if these were a slope.
    assert dice(after(organ, scan_of(ball(11.0), blur=2.0)), ball(11.0)) > 0.95


def test_a_surface_stays_where_muscle_lies_between_bone_and_lung() -> None:
    bone, with_muscle = ball(10.0), ball(12.0)
    scan = scan_of(with_muscle, noise=0.0)
    scan[ball(11.0)] = TISSUE
    scan[bone] = 400
    np.testing.assert_array_equal(after(bone, scan), bone)


def test_what_is_grey_on_both_sides_of_a_black_gap_stays() -> None:
    """Two organs in the middle of the display window, between which there is a little gas."""
    organ = box_mask((EDGE,) * 3, slice(5, 35), slice(5, 35), slice(5, 20))
    scan = np.full((EDGE,) * 3, TISSUE, dtype=np.int16)
    scan[:, :, 20] = LUNG
    np.testing.assert_array_equal(after(organ, scan), organ)


def test_marked_places_stay_on_their_side() -> None:
    truth = ball(10.0)
    inside, outside = Mark((19.5, 19.5, 8.0), (1.5, 1.5, 1.5), True), Mark((19.5, 27.0, 19.5), (0.2, 0.2, 0.2), False)
    before = ball(9.0) & (np.indices(truth.shape)[1] < 27) | box_mask(truth.shape, slice(18, 22), slice(18, 22), slice(7, 11))
    moved = after(before, scan_of(truth), inside, outside)
    assert moved[19, 19, 8]
    assert not moved[20, 27, 20]
    assert not after(before, scan_of(truth))[19, 19, 8]
    assert after(before, scan_of(truth))[20, 27, 20]
    assert dice(moved, truth) > 0.97


def test_voxels_without_a_finite_intensity_stay_and_say_nothing() -> None:
    truth = ball(10.0)
    scan = scan_of(truth).astype(np.float32)
    expected = after(ball(9.0), scan)
    unknown = np.random.default_rng(1).random(truth.shape) < 0.1
    scan[unknown] = np.random.default_rng(2).choice([np.nan, np.inf, -np.inf], unknown.sum())
    moved = after(ball(9.0), scan)
    np.testing.assert_array_equal(moved[unknown], ball(9.0)[unknown])
    assert dice(moved[~unknown], expected[~unknown]) > 0.99
    np.testing.assert_array_equal(after(ball(9.0), np.full(truth.shape, np.nan)), ball(9.0))


@pytest.mark.filterwarnings("error")
def test_extreme_intensities_do_no_harm() -> None:
    scan = np.where(ball(10.0), np.float32(3e38), np.float32(-3e38))
    np.testing.assert_array_equal(after(ball(9.0), scan), ball(10.0))
    np.testing.assert_array_equal(after(ball(9.0), scan.astype(np.float64) * 1e260), ball(10.0))


def test_nothing_and_everything_stay_as_they_are() -> None:
    scan = scan_of(ball(10.0))
    for mask in (np.zeros(scan.shape, dtype=bool), np.ones(scan.shape, dtype=bool)):
        np.testing.assert_array_equal(after(mask, scan), mask)


def test_what_is_found_of_neighbourhoods_is_that_of_a_gaussian_of_one_voxel() -> None:
    mask, sums = together(ball(9.0), scan_of(ball(10.0)))
    assert sums.dtype == np.int16
    np.testing.assert_allclose(sums / WHOLE, ndimage.gaussian_filter(mask.astype(float), 1.0, mode="nearest"), atol=0.03)


def test_the_mask_is_left_as_it_was_however_it_is_stored() -> None:
    scan = scan_of(ball(10.0))
    expected = after(ball(9.0), scan)
    mask = ball(9.0).copy(order="F")
    np.testing.assert_array_equal(after(mask, scan.copy(order="F")), expected)
    np.testing.assert_array_equal(mask, ball(9.0))
    np.testing.assert_array_equal(after(ball(9.0)[::-1].copy()[::-1], scan[::-1].copy()[::-1]), expected)
    np.testing.assert_array_equal(after(mask, scan.astype(np.float32)), expected)


@pytest.mark.parametrize("voxels", [1, 3 * EDGE**2, 17 * EDGE**2])
@pytest.mark.parametrize("spacing", [(0.7, 0.7, 0.7), (3.0, 0.6, 0.8)])
def test_in_how_many_parts_it_is_done_makes_no_difference(
    monkeypatch: pytest.MonkeyPatch, voxels: int, spacing: tuple[float, float, float]
) -> None:
    marks = [Mark((19.0, 8.6, 19.0), (3.0, 3.0, 3.0), True), Mark((20.2, 18.0, 12.0), (2.2, 2.2, 2.2), False)]
    scan = scan_of(ball(10.0), noise=200.0)
    expected = together(ball(8.6), scan, *marks, spacing_mm=np.array(spacing))
    monkeypatch.setattr(half_height, "_VOXELS_HELD", voxels)
    found = together(ball(8.6), scan, *marks, spacing_mm=np.array(spacing))
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1])
    assert (expected[0] != ball(8.6)).any()


def test_a_part_of_a_volume_is_as_in_the_whole() -> None:
    scan, mask = scan_of(ball(10.0), noise=200.0), ball(8.6)
    box = slice(1, 39), slice(2, 40), slice(3, 38)
    np.testing.assert_array_equal(after(mask[box], scan[box], box=box), after(mask, scan)[box])


def test_a_volume_that_is_stored_backwards_has_the_same_blocks() -> None:
    scan, mask = scan_of(ball(10.0), noise=200.0), ball(8.6)
    spacing_mm, backwards = np.array([0.7, 0.7, 0.8]), np.array([1.0, 1.0, -1.0])
    assert EDGE % blocks_of(spacing_mm, WHOLE_BOX).edges[2]
    box = slice(0, EDGE), slice(0, EDGE), slice(1, EDGE)
    for voxels, of_mirrored in ((WHOLE_BOX, WHOLE_BOX), (box, (slice(0, EDGE), slice(0, EDGE), slice(0, EDGE - 1)))):
        expected = after(mask[voxels], scan[voxels], spacing_mm=spacing_mm, box=voxels)
        mirrored = mask[voxels][:, :, ::-1], scan[voxels][:, :, ::-1]
        found = after(*mirrored, spacing_mm=spacing_mm * backwards, box=of_mirrored)
        np.testing.assert_array_equal(found[:, :, ::-1], expected)


def test_it_can_be_cancelled_in_the_middle() -> None:
    with pytest.raises(Cancelled):
        list(
            at_half_height(ball(9.0), scan_of(ball(10.0)), blocks_of(CUBES, WHOLE_BOX), SOFT_TISSUE, between=cancel_at_call(30))
        )
