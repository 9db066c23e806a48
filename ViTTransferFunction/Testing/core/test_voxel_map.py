"""A map of which only a part is held answers as the whole array does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.bounding_box import whole_box
from ViTTransferFunction.Logic.core.geometry import Box, Geometry
from ViTTransferFunction.Logic.core.resampling import FixedPlaces, sample_at
from ViTTransferFunction.Logic.core.voxel_map import VoxelMap

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
    np.testing.assert_array_equal(voxels.at_places(FixedPlaces(GEOMETRY, points)), expected)


@given(boxes(), st.integers(20, 2000))
def test_voxels_spread_evenly_are_those_of_the_whole(held: Box, most: int) -> None:
    voxels, array = part_held(held)
    np.testing.assert_array_equal(voxels.spread(most), VoxelMap.whole(array).spread(most))
    assert len(voxels.spread(most)) < 2 * most + 1


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


@pytest.mark.parametrize("most", [1, 7, 10_000])
def test_a_map_that_is_there_is_whole(most: int) -> None:
    voxels = VoxelMap.whole(ELSEWHERE)
    assert voxels.array.base is ELSEWHERE or voxels.array is ELSEWHERE
    assert set(voxels.spread(most)) <= set(ELSEWHERE.ravel())
