"""How surely voxels belong to classes, from maps of which only a part is given, and where several claim them."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box, whole_box
from ViTTransferFunction.Logic.rendering.class_membership import Membership, PartialMap, memberships, nearest_voxels
from ViTTransferFunction.Testing.support.views import ball

SHAPE = (30, 36, 28)
ISO = 0.5
FAR = np.rint(255.0 * ball(SHAPE, (25.0, 31.0, 23.0), 2.5)).astype(np.uint8)
CLAIMED_TWICE = [
    np.rint(255.0 * ball(SHAPE, centre, radius, width=9.0)).astype(np.uint8)
    for centre, radius in (((8.0, 9.0, 7.0), 5.0), ((9.0, 15.0, 8.0), 6.0), ((13.0, 11.0, 12.0), 4.0))
]


def members(maps: list[np.ndarray | PartialMap], shape: tuple[int, int, int] = SHAPE) -> dict[int, Membership]:
    return dict(memberships(maps, [ISO] * len(maps), shape, [1.5] * len(maps)))


def whole(membership: Membership, shape: tuple[int, int, int] = SHAPE) -> np.ndarray:
    values = np.zeros(shape, dtype=np.uint8)
    values[membership.box] = membership.values
    return values


def part_of(similarity: np.ndarray, least: int) -> PartialMap:
    """The map with nothing but the box of what is at least so much."""
    box = bounding_box(similarity >= least)
    assert box is not None
    return PartialMap(similarity[box], box, similarity.shape)


@pytest.mark.parametrize("shape", [SHAPE, (20, 36, 17), (55, 60, 50)])
def test_a_part_of_a_map_gives_what_the_map_does_that_is_0_elsewhere(shape: tuple[int, int, int]) -> None:
    parts = [part_of(similarity, 40) for similarity in (*CLAIMED_TWICE, FAR)]
    wholes = [part.on(whole_box(SHAPE)) for part in parts]
    of_parts, of_wholes = members([*parts], shape), members([*wholes], shape)
    assert of_parts.keys() == of_wholes.keys() == {0, 1, 2, 3}
    for index, membership in of_parts.items():
        assert membership.box == of_wholes[index].box
        np.testing.assert_array_equal(membership.values, of_wholes[index].values)


def test_a_part_is_read_on_any_box_also_beside_it() -> None:
    part = PartialMap(np.full((2, 3, 4), 7, dtype=np.uint8), (slice(4, 6), slice(2, 5), slice(1, 5)), (9, 9, 9))
    assert part.on((slice(4, 6), slice(3, 4), slice(1, 3))).tolist() == [[[7, 7]], [[7, 7]]]
    assert part.on((slice(3, 5), slice(4, 6), slice(0, 2))).tolist() == [[[0, 0], [0, 0]], [[0, 7], [0, 0]]]
    assert part.on((slice(0, 2), slice(0, 9), slice(0, 9))).max() == 0


def test_of_several_classes_that_claim_a_voxel_the_largest_other_counts_against_each() -> None:
    together = members([*CLAIMED_TWICE])
    for index, membership in together.items():
        others = [similarity for other, similarity in enumerate(CLAIMED_TWICE) if other != index]
        # Two classes: this one, and what is the largest of the others everywhere.
        alone = members([CLAIMED_TWICE[index], np.maximum(*others)])[0]
        np.testing.assert_array_equal(whole(membership), whole(alone))
        assert not np.array_equal(whole(membership), whole(members([CLAIMED_TWICE[index]])[0]))


def test_classes_far_away_change_nothing() -> None:
    without, together = members([*CLAIMED_TWICE]), members([*CLAIMED_TWICE, FAR])
    for index, membership in without.items():
        np.testing.assert_array_equal(together[index].values, membership.values)
    np.testing.assert_array_equal(together[3].values, members([FAR])[0].values)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
@pytest.mark.parametrize("iso", [0.0, 0.003, 0.02])
def test_what_is_many_times_above_a_low_iso_value_is_well_inside(dtype: type, iso: float) -> None:
    similarity = FAR if dtype is np.uint8 else FAR.astype(np.float32) / np.float32(255.0)
    ((_, membership),) = memberships([similarity], [iso], SHAPE, [1.5])
    assert (whole(membership)[FAR > 100] == 255).all()


@pytest.mark.parametrize("shape", [SHAPE, (11, 36, 13)])
def test_voxels_of_a_part_are_those_of_all(shape: tuple[int, int, int]) -> None:
    array = np.random.default_rng(0).integers(-1000, 1000, SHAPE).astype(np.int16)
    part = (slice(3, 9), slice(0, 36), slice(5, 6))
    np.testing.assert_array_equal(nearest_voxels(array, shape, part), nearest_voxels(array, shape)[part])
    centres = [((np.arange(count) + 0.5) * size / count).astype(int) for count, size in zip(shape, SHAPE, strict=True)]
    np.testing.assert_array_equal(nearest_voxels(array, shape), array[np.ix_(*centres)])
