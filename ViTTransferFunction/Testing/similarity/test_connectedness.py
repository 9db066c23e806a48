"""Which cells are joined to a point by intensities like its own, and what that is worth in the kernel."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.similarity import connected_points
from ViTTransferFunction.Logic.similarity.connected_points import (
    LARGEST_SHARE,
    ConnectedPoints,
    between_points,
    joined_by_chains,
    point_factors,
    shares,
)
from ViTTransferFunction.Logic.similarity.connectedness import SIMILARITIES, TOLERANCES, Connectedness
from ViTTransferFunction.Logic.similarity.intensity_blocks import IntensityBlocks
from ViTTransferFunction.Testing.support.volumes import volume_of

EDGE, CELLS = 48, (12, 12, 12)
WINDOW = IntensityWindow(-160.0, 240.0)
TUBE_KJ, TWIN_KJ = (slice(8, 16), slice(8, 16)), (slice(32, 40), slice(32, 40))
IN_TUBE, END_OF_TUBE, IN_TWIN, OUTSIDE = (2, 2, 1), (2, 2, 11), (9, 9, 6), (6, 6, 6)
"""Cells, (K', J', I')."""


def tubes() -> Volume:
    """Two tubes of 200 along I in 0, which touch nowhere."""
    array = np.zeros((EDGE,) * 3, dtype=np.float32)
    array[TUBE_KJ] = array[TWIN_KJ] = 200.0
    return volume_of(array)


def blocks_of(volume: Volume, per_cell: int = 2) -> IntensityBlocks:
    return IntensityBlocks(volume, volume.geometry.resized(CELLS), WINDOW, per_cell)


def connected_points_of(volume: Volume) -> ConnectedPoints:
    return ConnectedPoints(blocks_of(volume), partial(blocks_of, volume, 1))


def position(volume: Volume, cell: tuple[int, int, int]) -> np.ndarray:
    middle: np.ndarray = volume.geometry.resized(CELLS).ijk_to_ras_points(np.array([cell[::-1]], dtype=float))[0]
    return middle


def joined_to(volume: Volume, cell: tuple[int, int, int]) -> np.ndarray:
    """C of all cells, (K', J', I'), with the middle of a cell."""
    levels = Connectedness(blocks_of(volume)).from_point(position(volume, cell))
    joined: np.ndarray = SIMILARITIES[levels].reshape(CELLS)
    return joined


def test_a_tube_is_joined_all_along_and_an_equal_one_beside_it_is_not() -> None:
    joined = joined_to(tubes(), IN_TUBE)
    assert joined[END_OF_TUBE] == SIMILARITIES[0]
    assert joined[IN_TWIN] == joined[OUTSIDE] == 0.0


def test_what_is_far_from_the_window_and_what_is_unknown_is_not_joined_to_what_lies_beside_it() -> None:
    volume = tubes()
    # Metal beside the tube, without limit; the twin is not known.
    volume.array[:, :, 24:] = 1e6
    volume.array[TUBE_KJ] = 200.0
    volume.array[TWIN_KJ] = np.nan
    joined = joined_to(volume, IN_TUBE)
    assert joined[END_OF_TUBE] == SIMILARITIES[0]
    assert joined[IN_TWIN] == joined[OUTSIDE] == 0.0


def test_a_wall_thinner_than_a_cell_parts_what_lies_on_either_side() -> None:
    volume = tubes()
    volume.array[:, :, 24:26] = 0.0
    joined = joined_to(volume, IN_TUBE)
    assert joined[2, 2, 4] == SIMILARITIES[0]
    assert joined[END_OF_TUBE] == 0.0


def test_the_weakest_place_on_the_best_way_decides() -> None:
    volume = tubes()
    step = 0.5 * float(TOLERANCES[1] + TOLERANCES[2])
    volume.array[:, :, 20:28][TUBE_KJ] -= step * WINDOW.width
    joined = joined_to(volume, IN_TUBE)
    assert joined[2, 2, 3] == SIMILARITIES[0]
    assert joined[2, 2, 6] == joined[END_OF_TUBE] == SIMILARITIES[2]


def test_the_same_volume_stored_in_another_order_has_the_same_cells_joined() -> None:
    volume = tubes()
    volume.array[:] += np.random.default_rng(0).normal(0.0, 8.0, volume.shape)
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = EDGE - 1
    mirrored = Volume(
        np.ascontiguousarray(volume.array[:, :, ::-1]), Geometry(volume.shape, volume.geometry.ijk_to_ras @ mirror)
    )
    i_of_mirror = CELLS[2] - 1 - IN_TUBE[2]
    np.testing.assert_array_equal(joined_to(mirrored, (*IN_TUBE[:2], i_of_mirror))[:, :, ::-1], joined_to(volume, IN_TUBE))


def test_a_point_on_nothing_finite_is_joined_to_its_own_place_alone() -> None:
    volume = tubes()
    volume.array[4:20, 4:20, :10] = np.nan
    joined = joined_to(volume, IN_TUBE)
    assert joined[IN_TUBE] == SIMILARITIES[0]
    assert np.count_nonzero(joined) < 10


def test_points_are_found_out_about_once_and_forgotten_when_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    volume = tubes()
    connected = connected_points_of(volume)
    asked = []
    original = Connectedness.from_point

    def counted(self: Connectedness, point_ras: np.ndarray) -> np.ndarray:
        asked.append(point_ras)
        return original(self, point_ras)

    monkeypatch.setattr(Connectedness, "from_point", counted)
    one, other = (position(volume, cell) for cell in (IN_TUBE, IN_TWIN))
    for points in ([one], [one, other], [other], [one, other]):
        connected.update(np.array(points))
    assert len(asked) == 3


def test_what_was_found_out_before_it_was_cancelled_is_kept() -> None:
    volume = tubes()
    connected = connected_points_of(volume)
    points = np.stack([position(volume, (2, 2, column)) for column in range(5)])
    begun = []

    def give_up_before_the_fourth() -> None:
        begun.append(1)
        if len(begun) == 4:
            raise Cancelled

    with pytest.raises(Cancelled):
        connected.update(points, give_up_before_the_fourth)
    connected.update(points, lambda: begun.append(1))
    assert len(begun) == 4 + 2


def test_points_known_to_the_block_have_other_keys_than_those_known_to_the_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    volume = tubes()
    connected = connected_points_of(volume)
    points = np.stack([position(volume, cell) for cell in (IN_TUBE, IN_TWIN, OUTSIDE)])
    finely = connected.update(points[:2])
    monkeypatch.setattr(connected_points, "FINELY_JOINED_POINTS", 2)
    coarsely = connected.update(points)
    assert not set(finely) & set(coarsely)
    of_cells = SIMILARITIES[Connectedness(blocks_of(volume, 1)).from_point(points[0])]
    np.testing.assert_array_equal(connected.at(coarsely[:1])[0], of_cells)
    assert connected.update(points[:2]) == finely


THREE_PLACES = np.arange(9.0).reshape(3, 3)


def of_three(first_two: float, to_third: float) -> np.ndarray:
    """C between three points."""
    return np.array([[1.0, first_two, to_third], [first_two, 1.0, to_third], [to_third, to_third, 1.0]])


def test_a_class_whose_points_are_joined_counts_on_it_and_one_of_two_parts_does_not() -> None:
    own = np.zeros(3, dtype=int)
    together, apart = (shares(THREE_PLACES, of_three(joined, joined), own, np.ones(3, dtype=bool)) for joined in (1.0, 0.0))
    np.testing.assert_allclose(together, LARGEST_SHARE * 3.5 / 4.0)
    np.testing.assert_allclose(apart, LARGEST_SHARE * 0.5 / 4.0)


def test_the_same_place_clicked_again_counts_once() -> None:
    places = THREE_PLACES[[0, 1, 1]]
    between = np.array([[1.0, 0.2, 0.2], [0.2, 1.0, 1.0], [0.2, 1.0, 1.0]])
    once = shares(places[:2], between[:2, :2], np.zeros(2, dtype=int), np.ones(2, dtype=bool))
    again = shares(places, between, np.zeros(3, dtype=int), np.ones(3, dtype=bool))
    assert again[0] == once[0]


def test_negative_points_and_other_classes_have_no_say_but_share_their_own_class_s() -> None:
    classes, positive = np.array([0, 0, 0, 1]), np.array([True, True, False, True])
    between = np.eye(4)
    between[0, 1] = between[1, 0] = 1.0
    found = shares(np.arange(12.0).reshape(4, 3), between, classes, positive)
    np.testing.assert_allclose(found, LARGEST_SHARE * np.array([0.75, 0.75, 0.75, 0.5]))


def test_either_points_intensity_may_join_a_pair() -> None:
    np.testing.assert_array_equal(between_points(np.array([[0.2, 0.9], [0.1, 0.3]])), [[1.0, 0.9], [0.9, 1.0]])


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, LARGEST_SHARE), st.floats(0.0, LARGEST_SHARE))
def test_factors_between_points_keep_their_own_weight_and_never_exceed_it(
    first_two: float, to_third: float, share: float, other: float
) -> None:
    factors = point_factors(of_three(first_two, to_third), np.array([share, other, other]))
    np.testing.assert_allclose(np.diag(factors), 1.0)
    np.testing.assert_array_equal(factors, factors.T)
    assert factors.min() >= 0.0
    assert factors.max() <= 1.0 + 1e-12


@pytest.mark.parametrize("points", [1, 2, 3, 7, 40])
def test_a_chain_joins_as_well_as_the_weakest_of_its_links(points: int) -> None:
    generator = np.random.default_rng(points)
    # Few pairs are joined well, so that chains are long.
    weak = generator.choice(len(SIMILARITIES), (points, points), p=[0.03, 0.03, 0.04, 0.1, 0.2, 0.6])
    between = between_points(SIMILARITIES[weak])
    expected = np.zeros_like(between)
    for similarity in SIMILARITIES[::-1]:
        _, groups = connected_components(between >= similarity, directed=False)
        expected[groups[:, None] == groups] = similarity
    np.fill_diagonal(expected, 1.0)
    found = joined_by_chains(between)
    assert found.dtype == between.dtype
    np.testing.assert_array_equal(found, expected)


def test_points_that_are_joined_by_way_of_a_third_leave_the_kernel_positive_semidefinite() -> None:
    joined = SIMILARITIES[0]
    # A star: one point is joined to all others, of which no two are joined.
    between = np.eye(12)
    between[0, 1:] = between[1:, 0] = joined
    factors = point_factors(between, np.full(12, 0.6))
    assert np.linalg.eigvalsh(factors).min() > -1e-6


def test_the_kernel_of_many_points_in_a_textured_structure_is_positive_semidefinite() -> None:
    generator = np.random.default_rng(0)
    voxels = 20.0 * generator.normal(size=(16, 16, 16)).cumsum(axis=0) / 3.0
    volume = Volume(voxels, Geometry(voxels.shape, np.eye(4)))
    cells = volume.geometry.resized((8, 8, 8))
    connectedness = Connectedness(IntensityBlocks(volume, cells, WINDOW))
    places = generator.choice(512, 120, replace=False)
    points = cells.voxel_centres_ras()[places]
    at_points = np.stack([SIMILARITIES[connectedness.from_point(point)[places]] for point in points])
    factors = point_factors(between_points(at_points), np.full(120, 0.6))
    assert np.linalg.eigvalsh(factors).min() > -1e-6
