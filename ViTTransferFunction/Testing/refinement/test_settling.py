"""Settled maps: what changes in them, what does not, and on which side points lie."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.core.volumes.bounding_box import whole_box
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.orientation import AS_STORED, Orientation
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.refinement import settling
from ViTTransferFunction.Logic.refinement.refinement import refine
from ViTTransferFunction.Logic.refinement.settling import settle
from ViTTransferFunction.Logic.refinement.threshold_dynamics import Mark
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

WINDOW = IntensityWindow(0.0, 200.0)
EDGE = 40
ISO = 0.4
NO_POINTS = np.empty((0, 3))
CENTRE = np.full((1, 3), 20.0)


def scan_and_map() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A noisy ball, its mask, and a map whose surface is as rough as the noise."""
    axis = np.arange(EDGE) - 20.0
    truth = (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2) < 10.0**2
    random = np.random.default_rng(0)
    scan = np.where(truth, 120.0, 80.0) + random.normal(0.0, 30.0, truth.shape)
    soft = ndimage.gaussian_filter(truth.astype(float), 1.5) * np.exp(random.normal(0.0, 0.4, truth.shape))
    return scan.astype(np.float32), truth, np.clip(soft, 0.0, 1.0).astype(np.float32)


def settled_map(negative: np.ndarray = NO_POINTS, positive: np.ndarray = CENTRE, iso: float = ISO) -> np.ndarray:
    scan, _, array = scan_and_map()
    voxels = held_whole(array)
    settle(voxels, volume_of(scan), WINDOW, positive, negative, iso)
    return voxels.held


def held_whole(array: np.ndarray) -> VoxelMap:
    """A map of cells of four voxels."""
    coarse = array[2::4, 2::4, 2::4]
    box = (slice(0, EDGE), slice(0, EDGE), slice(0, EDGE))
    return VoxelMap((EDGE, EDGE, EDGE), coarse, lambda k, rows: array[k, rows], box, array.copy())


def test_a_rough_surface_becomes_that_of_the_structure() -> None:
    _, truth, array = scan_and_map()
    assert dice(array >= ISO, truth) < 0.93
    assert dice(settled_map() >= ISO, truth) > 0.96


@pytest.mark.parametrize("low", [0.0, 500.0], ids=["as it is displayed", "displayed as plain black"])
def test_a_surface_moves_to_where_intensities_change(low: float) -> None:
    _, truth, _ = scan_and_map()
    scan = np.where(truth, 120.0, 80.0).astype(np.float32)
    voxels = held_whole(ndimage.binary_dilation(truth, iterations=2).astype(np.float32))
    assert dice(voxels.held >= ISO, truth) < 0.8
    settle(voxels, volume_of(scan), IntensityWindow(low, low + 200.0), CENTRE, NO_POINTS, ISO)
    assert dice(voxels.held >= ISO, truth) > 0.97


def test_voxels_that_stay_on_their_side_keep_their_values() -> None:
    _, _, array = scan_and_map()
    settled = settled_map()
    stayed = (array >= ISO) == (settled >= ISO)
    np.testing.assert_array_equal(settled[stayed], array[stayed])
    assert 0 < (~stayed).sum() < 0.1 * stayed.size


def test_sizes_nest_and_bring_back_first_what_has_least_around_it() -> None:
    settled = settled_map()
    counts = [int((settled >= iso).sum()) for iso in (0.3 * ISO, 0.6 * ISO, 0.95 * ISO, ISO, 1.05 * ISO, 1.3 * ISO, 1.7 * ISO)]
    assert counts == sorted(counts, reverse=True)
    # A little larger or smaller is not as rough as it was before.
    assert counts[2] - counts[4] < 0.25 * counts[3]


def test_points_lie_on_their_own_side() -> None:
    _, truth, _ = scan_and_map()
    negative, positive = np.array([[20.0, 20.0, 27.0]]), np.array([[20.0, 20.0, 20.0], [20.0, 33.0, 20.0]])
    assert truth[27, 20, 20]
    assert not truth[20, 33, 20]
    inside = settled_map(negative, positive) >= ISO
    assert not inside[27, 20, 20]
    assert inside[20, 33, 20]
    assert inside[20, 20, 20]


def test_points_away_from_a_structure_are_left_out_and_those_whose_places_reach_it_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With many structures, most points are others', and far away."""
    given: list[Mark] = []
    of_part: list[tuple[int, ...]] = []

    def settled_with(
        mask: np.ndarray, intensities: np.ndarray, window: IntensityWindow, marks: list[Mark], between: object
    ) -> list:
        given.extend(marks)
        of_part.append(mask.shape)
        return [mask]

    monkeypatch.setattr(settling, "settled", settled_with)
    small = np.zeros((EDGE, EDGE, EDGE), dtype=np.float32)
    small[18:23, 18:23, 18:23] = 1.0
    lattice = np.stack(np.meshgrid(*3 * [np.linspace(0.0, EDGE - 1.0, 14)]), axis=-1).reshape(-1, 3)
    voxels = held_whole(small)
    settle(voxels, volume_of(small), WINDOW, CENTRE, lattice, ISO)
    (shape,) = of_part
    first = (EDGE - shape[0]) // 2
    everywhere = [Mark((k - first, j - first, i - first), (1.0, 1.0, 1.0), False) for k, j, i in lattice.tolist()]
    assert len(given) < 0.5 * len(lattice)
    assert sum(reaches(mark, shape) for mark in given) == sum(reaches(mark, shape) for mark in everywhere) + len(CENTRE) > 100


def reaches(mark: Mark, shape: tuple[int, ...]) -> bool:
    """Whether a mark says something of voxels of a part of `shape`."""
    return bool(mark.known_of(shape)[1].any())


def test_points_on_the_faces_of_the_volume_lie_on_their_own_side() -> None:
    """They may be a little beyond, where they were rounded when they were saved."""
    scan, truth, array = scan_and_map()
    cut = (slice(20, 28), slice(20, EDGE), slice(20, EDGE))
    for layer, face in ((0, -0.5005), (0, -0.5), (7, 7.5), (7, 7.5005)):
        voxels = VoxelMap.whole(array[cut].copy())
        negative, positive = np.array([[1.0, 1.0, face]]), np.array([[3.0, 3.0, 3.0], [14.0, 14.0, face]])
        assert truth[cut][layer, 1, 1]
        assert not truth[cut][layer, 14, 14]
        inside = settle(voxels, volume_of(scan[cut]), WINDOW, positive, negative, ISO).held >= ISO
        assert not inside[layer, 1, 1]
        assert inside[layer, 14, 14]


@pytest.mark.parametrize("stored", [AS_STORED, Orientation((2, 0, 1), (True, False, True))])
def test_a_point_between_voxels_lies_in_the_same_one_however_the_scan_is_stored(stored: Orientation) -> None:
    scan, _, array = scan_and_map()
    volume, between = stored_as(volume_of(scan), stored), np.array([[19.5, 33.5, 20.5]])
    voxels = VoxelMap.whole(np.ascontiguousarray(stored.to_canonical(array)))
    settled = settle(voxels, volume, WINDOW, np.vstack([CENTRE, between]), NO_POINTS, ISO).held
    inside = np.argwhere(settled >= ISO)
    places = volume.geometry.ijk_to_ras_points(inside[:, ::-1])
    near = np.linalg.norm(places - between, axis=1) < 2.5
    np.testing.assert_array_equal(places[near], [[20.0, 34.0, 21.0]])
    np.testing.assert_array_equal(inside[near], volume.geometry.nearest_voxels(between))


@pytest.mark.parametrize("iso", [0.001, 0.9, 1.0])
def test_values_stay_between_0_and_1_whatever_the_threshold(iso: float) -> None:
    settled = settled_map(iso=iso)
    assert settled.dtype == np.float32
    assert settled.min() >= 0.0
    assert settled.max() <= 1.0


def test_a_map_that_does_not_reach_its_threshold_stays_as_it_is() -> None:
    scan, _, array = scan_and_map()
    voxels = held_whole(0.3 * array)
    settle(voxels, volume_of(scan), WINDOW, CENTRE, NO_POINTS, ISO)
    np.testing.assert_array_equal(voxels.held, 0.3 * array)


def test_of_a_map_held_in_part_that_part_settles_as_in_the_whole() -> None:
    scan, truth, array = scan_and_map()
    box = (slice(1, 39), slice(2, 39), slice(3, 40))
    whole = held_whole(array)
    part = VoxelMap(whole.shape, whole.coarse, whole.interpolated, box, array[box].copy())
    for voxels in (whole, part):
        settle(voxels, volume_of(scan), WINDOW, CENTRE, NO_POINTS, ISO)
    assert dice(part.held >= ISO, truth[box]) > 0.96
    assert ((part.held >= ISO) != (whole.held[box] >= ISO)).mean() < 0.002


@pytest.mark.parametrize("threshold", [0.2, 0.35])
def test_as_much_of_a_refined_map_is_held_as_its_surface_settles_in(threshold: float) -> None:
    scan, _, array = scan_and_map()
    volume = volume_of(np.pad(scan, 20, mode="reflect"))
    coarse = np.pad(array, 20).reshape(20, 4, 20, 4, 20, 4).mean(axis=(1, 3, 5))
    centre = CENTRE + 20.0
    part = refine(coarse, volume, WINDOW, centre, 0.35, "bilateral")
    assert part.held.size < part.array.size
    whole = replace(part, box=whole_box(part.shape), held=part.array.copy())
    of_part, of_whole = (settle(voxels, volume, WINDOW, centre, NO_POINTS, threshold).array for voxels in (part, whole))
    assert (of_part >= threshold).any()
    np.testing.assert_array_equal(of_part, of_whole)


def test_what_has_joined_is_found_though_the_coarse_map_does_not_reach_there() -> None:
    _, truth, _ = scan_and_map()
    whole = held_whole(ndimage.binary_erosion(truth, iterations=3).astype(np.float32))
    core = (slice(13, 28), slice(13, 28), slice(13, 28))
    voxels = settle(replace(whole, refined=core), volume_of(80.0 + 40.0 * truth), WINDOW, CENTRE, NO_POINTS, ISO)
    inside = voxels.held >= ISO
    assert inside.sum() > inside[core].sum()
    box = voxels.box_above(ISO)
    assert box is not None
    assert inside.sum() == inside[box].sum()


LUNG_CT = IntensityWindow(-160.0, 240.0)


def nodule_and_map() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A nodule in lung, its edge blurred, what is half of it and more, and a map that ends where it begins to be lung."""
    axis = np.arange(EDGE) - 20.0
    sharp = (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2) < 7.0**2
    share = ndimage.gaussian_filter(sharp.astype(float), 1.0)
    scan = -850.0 + 880.0 * share + np.random.default_rng(0).normal(0.0, 20.0, share.shape)
    return scan.astype(np.float32), share > 0.5, np.clip(share - 0.4, 0.0, 1.0).astype(np.float32)


def settled_nodule(negative: np.ndarray = NO_POINTS) -> np.ndarray:
    scan, _, array = nodule_and_map()
    voxels = held_whole(array)
    settle(voxels, volume_of(scan), LUNG_CT, CENTRE, negative, ISO)
    return voxels.held


def test_a_nodule_in_lung_ends_halfway_up_its_edge() -> None:
    _, truth, array = nodule_and_map()
    assert dice(array >= ISO, truth) < 0.8
    assert dice(settled_nodule() >= ISO, truth) > 0.97


def test_sizes_of_a_nodule_nest_and_take_back_gradually_what_it_got() -> None:
    _, _, array = nodule_and_map()
    settled = settled_nodule()
    got = (settled >= ISO) & (array < ISO)
    counts = [int((settled[got] >= iso).sum()) for iso in np.linspace(ISO, 1.7 * ISO, 8)]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < 0.1 * counts[0]
    assert max(before - after for before, after in pairwise(counts)) < 0.5 * counts[0]


def test_a_point_on_the_edge_of_a_nodule_stays_outside() -> None:
    at = np.array([[20.0, 20.0, 26.0]])
    assert settled_nodule()[26, 20, 20] >= ISO
    assert settled_nodule(at)[26, 20, 20] < ISO
