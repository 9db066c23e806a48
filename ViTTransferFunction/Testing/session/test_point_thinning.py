"""Many points are thinned to those that differ."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.session.point_thinning import MOST_POINTS, thinned

GEOMETRY = Geometry((60, 80, 100), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))
EDGES = np.array(GEOMETRY.shape[::-1]) - 0.5


def points(count: int, seed: int = 0) -> np.ndarray:
    return GEOMETRY.ijk_to_ras_points(np.random.default_rng(seed).uniform(-0.5, EDGES, (count, 3)))


def test_no_more_than_the_most_are_left_as_they_are() -> None:
    in_one_voxel = points(1) + np.random.default_rng(0).uniform(-1e-9, 1e-9, (MOST_POINTS - 10, 3))
    requests = [ClassRequest("a", in_one_voxel, points(5)), ClassRequest("b", points(5))]
    assert all(thin is request for thin, request in zip(thinned(requests, GEOMETRY), requests, strict=True))


def test_each_place_of_a_list_counts_once_where_it_came_first() -> None:
    places = points(3)
    again = ClassRequest("a", places[[0, 1, 0, 2, 1]], places[[2, 2]])
    (once,) = thinned([again], GEOMETRY)
    np.testing.assert_array_equal(once.positive, places)
    np.testing.assert_array_equal(once.negative, places[2:])


@pytest.mark.parametrize("count", [MOST_POINTS + 1, 5000, 50_000])
def test_more_become_some_of_them_spread_over_all_and_stay_at_that(count: int) -> None:
    (request,) = thinned([ClassRequest("a", points(count))], GEOMETRY)
    assert MOST_POINTS / 3 < len(request.positive) <= MOST_POINTS
    given = {point.tobytes() for point in points(count)}
    assert all(point.tobytes() in given for point in request.positive)
    octants = GEOMETRY.ras_to_ijk(request.positive) > EDGES / 2
    assert np.bincount(octants @ [1, 2, 4], minlength=8).min() > MOST_POINTS / 3 / 16
    assert thinned([request], GEOMETRY)[0] is request


def test_points_in_one_voxel_count_once() -> None:
    few = points(20)
    same = few + np.random.default_rng(0).uniform(-1e-9, 1e-9, (500, 20, 3))
    (request,) = thinned([ClassRequest("a", same.reshape(-1, 3))], GEOMETRY)
    assert len(request.positive) == 20
    np.testing.assert_allclose(request.positive, few, atol=1e-6)


@pytest.mark.parametrize("face", [-0.5, EDGES[0]])
def test_points_that_were_rounded_beyond_a_face_lie_in_its_voxels(face: float) -> None:
    across = np.linspace((face - 5e-4, 10.0, 10.0), (face + 5e-4, 10.0, 10.0), 2 * MOST_POINTS)
    beside = GEOMETRY.ijk_to_ras_points(across)
    assert GEOMETRY.contains(beside).all()
    (request,) = thinned([ClassRequest("a", beside)], GEOMETRY)
    assert len(request.positive) == 1


def test_points_that_were_rounded_beyond_a_face_are_thinned_as_those_within() -> None:
    on_face = np.random.default_rng(0).uniform(-0.5, EDGES, (5000, 3))
    on_face[:, 0] = -0.5 + np.random.default_rng(1).uniform(-5e-4, 5e-4, 5000)
    beside = GEOMETRY.ijk_to_ras_points(on_face)
    assert GEOMETRY.contains(beside).all()
    (request,) = thinned([ClassRequest("a", beside)], GEOMETRY)
    assert MOST_POINTS / 3 < len(request.positive) <= MOST_POINTS


def test_as_many_points_are_left_of_a_length_along_every_axis() -> None:
    thick = Geometry((30, 150, 150), np.diag([1.0, 1.0, 5.0, 1.0]))
    along = np.linspace(0.0, 140.0, 5000)[:, None]
    strokes = [along * axis for axis in np.eye(3)]
    others = [ClassRequest(str(number), points) for number in range(9) for points in strokes[:1]]
    (request, *_) = thinned([ClassRequest("a", np.concatenate(strokes)), *others], thick)
    left = [np.count_nonzero(request.positive[:, axis] > 20.0) for axis in range(3)]
    assert min(left) >= 5
    assert max(left) <= min(left) + 1


def test_of_more_lists_than_points_may_be_left_each_keeps_one() -> None:
    requests = [ClassRequest(str(number), points(2, number), points(2, number + 1)) for number in range(MOST_POINTS)]
    assert all((len(thin.positive), len(thin.negative)) == (1, 1) for thin in thinned(requests, GEOMETRY))


def test_few_points_of_a_class_are_all_kept_beside_many_of_another() -> None:
    few, many = thinned(
        [ClassRequest("few", points(3), points(4)), ClassRequest("many", points(9000), points(9000, 1))], GEOMETRY
    )
    assert (len(few.positive), len(few.negative)) == (3, 4)
    assert len(many.positive) + len(many.negative) <= MOST_POINTS
    assert min(len(many.positive), len(many.negative)) > 20


def test_a_close_up_stays_as_large_as_all_points_want_it_however_many_are_left() -> None:
    close_up = CloseUp.of_box((slice(20, 40), slice(30, 50), slice(30, 60)), GEOMETRY)
    # Out of the box, the last of each cell the farthest.
    line = GEOMETRY.ijk_to_ras_points(np.linspace((45.0, 40.0, 30.0), (85.3, 40.0, 30.0), 5000))
    painted = ClassRequest("painted", line, close_up=close_up)
    wanted = close_up.box_in(GEOMETRY, line)
    for others in ([], [ClassRequest("other", points(9000), points(9000, 1))]):
        thin, *_ = thinned([painted, *others], GEOMETRY)
        assert thin.close_up is not None
        assert not (thin.positive == line[-1]).all(axis=1).any()
        assert thin.close_up.box_in(GEOMETRY, thin.positive) == wanted
