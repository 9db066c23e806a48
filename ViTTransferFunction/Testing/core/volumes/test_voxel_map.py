"""A map of which only a part is held answers as the whole array does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.volumes.bounding_box import whole_box
from ViTTransferFunction.Logic.core.volumes.geometry import Box, Geometry
from ViTTransferFunction.Logic.core.volumes.orientation import AS_STORED, Orientation, canonical_orientation
from ViTTransferFunction.Logic.core.volumes.resampling import FixedPlaces, sample_at
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

SHAPE = (12, 10, 8)
GEOMETRY = Geometry(SHAPE, np.diag([1.5, 2.0, 3.0, 1.0]))
COARSE = np.random.default_rng(0).random((6, 5, 4), dtype=np.float32)
ELSEWHERE = COARSE.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)


def part_held(box: Box) -> tuple[VoxelMap, np.ndarray]:
    """A map whose voxels in a box are others than the nearest cell's, and all of it as an array."""
    array = ELSEWHERE.copy()
    array[box] = np.random.default_rng(1).random(array[box].shape, dtype=np.float32)
    return VoxelMap(SHAPE, COARSE, lambda k, rows: ELSEWHERE[k, rows], box, array[box].copy()), array


def boxes() -> st.SearchStrategy[Box]:
    """Boxes in the volume, empty ones as well."""
    extents = [
        st.tuples(st.integers(0, size), st.integers(0, size)).map(lambda ends: slice(min(ends), max(ends))) for size in SHAPE
    ]
    return st.tuples(*extents)


@given(boxes(), boxes())
def test_any_part_is_that_of_the_whole(held: Box, asked: Box) -> None:
    voxels, array = part_held(held)
    np.testing.assert_array_equal(voxels.part(asked), array[asked])
    np.testing.assert_array_equal(voxels.array, array)


@given(boxes())
def test_samples_at_points_are_those_of_the_whole(held: Box) -> None:
    voxels, array = part_held(held)
    points = np.random.default_rng(2).uniform(-3.0, 27.0, (50, 3))
    expected = sample_at(array[..., None], GEOMETRY, points)[:, 0]
    np.testing.assert_array_equal(voxels.at(GEOMETRY, points), expected)


@given(boxes())
def test_at_centres_of_cells_it_is_the_held_map_or_the_coarse_one(held: Box) -> None:
    voxels, array = part_held(held)
    cells = GEOMETRY.resized(COARSE.shape)
    some = np.random.default_rng(3).permutation(COARSE.size)[:60]
    centres = cells.voxel_centres_ras()[some]
    at_cells = voxels.at_cells(some, FixedPlaces(GEOMETRY, centres))
    # A cell is two voxels wide: its centre lies between all eight of its voxels.
    k, j, i = (2 * along for along in np.unravel_index(some, COARSE.shape))
    inside = np.all([(at >= e.start) & (at + 2 <= e.stop) for at, e in zip((k, j, i), held, strict=True)], axis=0)
    expected = sample_at(array[..., None], GEOMETRY, centres)[:, 0]
    np.testing.assert_array_equal(at_cells, np.where(inside, expected, COARSE.ravel()[some]))


@given(boxes(), st.integers(20, 2000))
def test_values_are_spread_evenly_and_stand_for_all_voxels(held: Box, most: int) -> None:
    voxels, array = part_held(held)
    spread = list(voxels.spread(most, AS_STORED))
    everything = sum(len(values) * each for values, each in spread)
    assert sum(len(values) for values, _ in spread) <= most + COARSE.size
    # Every n-th voxel, and cells by where their centres are.
    assert everything == pytest.approx(array.size, abs=max(each for _, each in spread) + 0.5 * array.size)
    for values, _ in spread:
        assert set(values.tolist()) <= set(array[held].ravel().tolist()) | set(COARSE.ravel().tolist())


@pytest.mark.parametrize("stored", [Orientation((0, 1, 2), (True, True, True)), Orientation((2, 0, 1), (False, True, False))])
def test_the_same_values_are_looked_at_however_a_scan_is_stored(stored: Orientation) -> None:
    """The threshold is chosen from them: of other ones, that of a small structure in a large box is another."""
    scan = volume_of(np.random.default_rng(5).random((30, 20, 25), dtype=np.float32))

    def looked_at(of: Volume) -> np.ndarray:
        ((values, _),) = VoxelMap.whole(of.array).spread(500, canonical_orientation(of.geometry))
        return values

    assert 250 < len(looked_at(scan)) <= 500
    np.testing.assert_array_equal(looked_at(stored_as(scan, stored)), looked_at(scan))


@given(st.tuples(*(st.tuples(st.integers(0, n), st.integers(0, n)).map(sorted) for n in COARSE.shape)))
def test_a_box_of_whole_cells_takes_those_cells_places(cells: tuple[list[int], ...]) -> None:
    held = tuple(slice(2 * first, 2 * end) for first, end in cells)
    voxels, array = part_held((held[0], held[1], held[2]))
    spread = list(voxels.spread(10**6, AS_STORED))
    assert sum(len(values) * each for values, each in spread) == array.size
    total = sum(float(values.astype(float).sum()) * each for values, each in spread)
    assert total == pytest.approx(array.astype(float).sum(), rel=1e-6)


@given(boxes(), st.floats(0.01, 1.0))
def test_nothing_outside_of_the_box_above_a_value_reaches_it(held: Box, value: float) -> None:
    voxels, array = part_held(held)
    box = voxels.box_above(value)
    if box is not None:
        array[box] = 0.0
    assert (array < value).all()


@given(boxes(), st.floats(0.01, 1.0))
def test_a_map_that_is_held_whole_is_looked_for_no_further_than_where_it_was_refined(refined: Box, value: float) -> None:
    voxels, array = part_held(refined)
    whole = VoxelMap(SHAPE, COARSE, voxels.interpolated, whole_box(SHAPE), array, refined=refined)
    assert whole.box_above(value) == voxels.box_above(value)


def test_a_map_of_a_part_is_that_of_the_whole_with_nothing_beyond() -> None:
    box = slice(3, 9), slice(0, 10), slice(4, 8)
    part = np.random.default_rng(4).random((6, 10, 4), dtype=np.float32)
    whole = np.zeros(SHAPE, dtype=np.float32)
    whole[box] = part
    placed = VoxelMap.whole(part).placed(SHAPE, box)
    np.testing.assert_array_equal(placed.array, whole)
    np.testing.assert_array_equal(placed.part((slice(0, 6), slice(2, 5), slice(3, 8))), whole[:6, 2:5, 3:8])
    assert placed.box_above(0.01) == box


@pytest.mark.parametrize("most", [1, 7, 10_000])
def test_a_map_that_is_there_is_whole(most: int) -> None:
    voxels = VoxelMap.whole(ELSEWHERE)
    assert voxels.array.base is ELSEWHERE or voxels.array is ELSEWHERE
    ((values, each),) = voxels.spread(most, AS_STORED)
    assert set(values) <= set(ELSEWHERE.ravel())
    assert abs(len(values) * each - ELSEWHERE.size) < each
