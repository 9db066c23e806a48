"""Volumes of structures: where rays may leap."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_cdt, maximum_filter

from ViTTransferFunction.Logic.rendering.composition import (
    BLOCK_VOXELS,
    DEPTH,
    LIGHT,
    MOST_BLOCKS_AWAY,
    MOST_STRUCTURES,
    NUMBER,
    SURFACE,
    Composition,
)

SHAPE = (37, 30, 41)


def composed(boxes: list[tuple[slice, slice, slice]]) -> np.ndarray:
    """A volume of structures that fill these boxes."""
    composition = Composition(SHAPE, len(boxes))
    for index, box in enumerate(boxes):
        composition.add(box, index, np.full([extent.stop - extent.start for extent in box], 200, dtype=np.uint8))
    return composition.voxels()


@pytest.mark.parametrize(
    "boxes",
    [
        [(slice(5, 9), slice(3, 4), slice(30, 41))],
        [(slice(0, 1), slice(0, 1), slice(0, 1)), (slice(33, 37), slice(10, 21), slice(2, 3))],
        [(slice(17, 22), slice(13, 18), slice(19, 24))],
    ],
)
def test_no_surface_is_in_the_cube_of_blocks_that_a_voxel_says_is_empty(boxes: list[tuple[slice, slice, slice]]) -> None:
    voxels = composed(boxes)
    # A surface lies between a voxel and its neighbours.
    near = maximum_filter(voxels[..., DEPTH], size=3) > SURFACE
    blocks = np.zeros([-(-size // BLOCK_VOXELS) for size in SHAPE], dtype=bool)
    np.logical_or.at(blocks, tuple(np.argwhere(near).T // BLOCK_VOXELS), True)
    away = distance_transform_cdt(~blocks, "chessboard").repeat(4, 0).repeat(4, 1).repeat(4, 2)
    said = np.maximum(voxels[..., NUMBER].astype(int) - MOST_STRUCTURES, 0)
    assert np.array_equal(said, away[tuple(slice(0, size) for size in SHAPE)])


def test_what_is_soft_about_a_structure_does_not_keep_rays_from_leaping() -> None:
    composition = Composition((16, 16, 16), 1)
    depths = np.full((12, 16, 16), 100, dtype=np.uint8)
    depths[:2] = 255
    composition.add((slice(0, 12), slice(0, 16), slice(0, 16)), 0, depths)
    along = composition.voxels()[:, 8, 8]
    assert along[:4, NUMBER].tolist() == [1] * 4
    assert along[4:, NUMBER].tolist() == [MOST_STRUCTURES + away for away in (1, 2, 3) for _ in range(4)]
    assert along[2:12, DEPTH].tolist() == [100] * 10


def test_voxels_of_structures_keep_their_numbers() -> None:
    boxes = [(slice(4, 9), slice(3, 7), slice(3, 40)), (slice(20, 30), slice(3, 7), slice(8, 12))]
    voxels = composed(boxes)
    for number, box in enumerate(boxes, start=1):
        assert (voxels[box][..., NUMBER] == number).all()


def test_where_there_is_no_structure_rays_leap_out_of_the_volume() -> None:
    assert (composed([])[..., NUMBER] == MOST_STRUCTURES + MOST_BLOCKS_AWAY).all()


def test_a_structure_in_two_places_has_its_number_in_both() -> None:
    composition = Composition((16, 16, 16), 1)
    for start in (0, 11):
        composition.add((slice(start, start + 5),) * 3, 0, np.full((5, 5, 5), 255, dtype=np.uint8))
    voxels = composition.voxels()
    assert (voxels[11:, 11:, 11:, NUMBER] == 1).all()
    assert (voxels[:5, :5, :5, NUMBER] == 1).all()


def test_what_is_around_structures_can_be_left_out() -> None:
    box = (slice(5, 9), slice(0, 4), slice(30, 41))
    whole = composed([box])
    composition = Composition(SHAPE, 1)
    composition.add(box, 0, np.full((4, 4, 11), 200, dtype=np.uint8))
    part = composition.crop()
    voxels = composition.voxels()
    assert voxels.shape[:3] == composition.shape == (16, 12, 17)
    assert np.array_equal(voxels[..., DEPTH], whole[part][..., DEPTH])
    assert (voxels[..., DEPTH] > 0).sum() == 4 * 4 * 11


def test_where_there_is_no_structure_nothing_is_left_out() -> None:
    composition = Composition(SHAPE, 1)
    composition.crop()
    assert composition.voxels().shape[:3] == SHAPE


def test_of_structures_in_which_a_voxel_lies_equally_deep_the_first_has_it() -> None:
    box = (slice(5, 9), slice(4, 8), slice(30, 41))
    voxels = composed([box, box])
    assert (voxels[box][..., NUMBER] == 1).all()


def test_shadows_lie_alike_on_both_sides_of_a_structure() -> None:
    # They are known at every third voxel: at both ends, too.
    composition = Composition((193, 60, 60), 1)
    composition.add((slice(84, 109), slice(0, 60), slice(0, 60)), 0, np.full((25, 60, 60), 255, dtype=np.uint8))
    light = composition.voxels()[..., LIGHT].astype(int)
    np.testing.assert_allclose(light, light[::-1], atol=1)
    along = light[:, 30, 30]
    assert along[96] < along[84] < along[78] <= along[0] == 255
    # In between as well.
    assert np.abs(np.diff(along)).max() < 20
