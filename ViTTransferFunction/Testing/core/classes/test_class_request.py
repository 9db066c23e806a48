"""What may be requested of classes, and when two requests are the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest, check_requests, different_places, points_against
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

GEOMETRY = Geometry((20, 30, 40), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))
POINTS_RAS = GEOMETRY.ijk_to_ras_points(np.array([[3.0, 4.0, 5.0], [10.5, 20.25, 15.0]]))


def test_classes_must_exist_differ_in_name_and_lie_inside_the_volume() -> None:
    inside = ClassRequest("a", POINTS_RAS)
    check_requests([inside], GEOMETRY)
    with pytest.raises(InputError, match="no classes"):
        check_requests([], GEOMETRY)
    with pytest.raises(InputError, match="2 classes are named 'a'"):
        check_requests([inside, inside], GEOMETRY)
    # One name in two forms of Unicode: an ü, and a u with two dots over it.
    with pytest.raises(InputError, match="2 classes are named 'Dr\u00fcse'"):
        check_requests([replace(inside, id=name, name=name) for name in ("Dr\u00fcse", "Dru\u0308se")], GEOMETRY)
    outside = ClassRequest("b", POINTS_RAS, negative=np.array([[1000.0, 0.0, 0.0]]))
    with pytest.raises(InputError, match=r"1 of 3 points of class 'b' lie outside the volume.*1000\.0"):
        check_requests([inside, outside], GEOMETRY)


def test_points_that_lie_inside_as_lps_are_said_to_be_so() -> None:
    flipped = ClassRequest("a", POINTS_RAS * [-1.0, -1.0, 1.0])
    advice = (
        r"class 'a' lie outside.*all points lie inside when read as LPS; if they are that, set \"coordinate_system\": \"LPS\""
        r".*Slicer's point lists call it \"coordinateSystem\""
    )
    with pytest.raises(InputError, match=advice):
        check_requests([flipped], GEOMETRY)
    with pytest.raises(InputError, match="Check the coordinate system"):
        check_requests([flipped, ClassRequest("b", POINTS_RAS)], GEOMETRY)


def test_points_of_which_some_lie_inside_by_chance_are_said_to_be_lps_too() -> None:
    around_zero = Geometry((10, 10, 10), np.diag([1.0, 1.0, 1.0, 1.0]) + np.eye(4, k=3) * -3.0)
    lps = ClassRequest("a", np.array([[0.0, 0.0, 2.0], [-5.0, 0.0, 2.0]]))
    with pytest.raises(InputError, match=r"1 of 2 points.*inside when read as LPS"):
        check_requests([lps], around_zero)


def test_points_that_lie_inside_as_voxels_are_said_to_be_so() -> None:
    voxels = ClassRequest("a", GEOMETRY.ras_to_ijk(POINTS_RAS))
    with pytest.raises(InputError, match=r"all points lie inside when read as voxels; if they are that, .*: \"IJK\""):
        check_requests([voxels], GEOMETRY)


def test_points_may_be_a_list_of_arrays_and_nothing_that_is_no_list_of_positions() -> None:
    np.testing.assert_array_equal(ClassRequest("a", list(POINTS_RAS)).positive, POINTS_RAS)  # type: ignore[arg-type]
    for no_points in (
        list(POINTS_RAS[:, :2]),
        POINTS_RAS[:, :2],
        POINTS_RAS[0],
        [POINTS_RAS > 0.0],
        POINTS_RAS * np.inf,
        "RAS",
    ):
        with pytest.raises(InputError, match=r"positive points of class 'a' are not a list of finite \[x, y, z\] positions"):
            ClassRequest("a", no_points)  # type: ignore[arg-type]


def test_a_class_without_a_name_is_called_by_its_id() -> None:
    assert ClassRequest("a", POINTS_RAS).name == "a"
    assert ClassRequest("a", POINTS_RAS, name="liver").name == "liver"


def test_classes_of_one_name_may_be_requested_together_and_those_of_one_id_may_not() -> None:
    first, second = (ClassRequest(id_, POINTS_RAS, name="liver") for id_ in ("a", "b"))
    check_requests([first, second], GEOMETRY)
    with pytest.raises(InputError, match="2 classes are named 'a'"):
        check_requests([first, replace(second, id="a")], GEOMETRY)


def test_requests_are_equal_where_all_that_decides_their_voxels_is_whatever_they_are_called() -> None:
    request = ClassRequest("a", POINTS_RAS, iso=0.3)
    assert request == ClassRequest("a", POINTS_RAS.tolist(), iso=0.3, name="liver")
    assert hash(request) == hash(ClassRequest("a", POINTS_RAS.copy(), iso=0.3, name="liver"))


@pytest.mark.parametrize(
    "change",
    [
        {"id": "b"},
        {"positive": POINTS_RAS + 1e-9},
        {"positive": POINTS_RAS[:1]},
        {"negative": POINTS_RAS},
        {"iso": 0.4},
        {"proximity": 0.1},
        {"refine": False},
    ],
    ids=lambda change: next(iter(change)),
)
def test_requests_differ_where_one_value_does(change: dict[str, Any]) -> None:
    request = ClassRequest("a", POINTS_RAS, iso=0.3)
    assert replace(request, **change) != request


def test_points_against_a_class_are_its_negative_ones_and_those_of_others_that_it_does_not_claim() -> None:
    a = ClassRequest("a", POINTS_RAS, negative=POINTS_RAS[:1] + 1.0)
    b = ClassRequest("b", np.concatenate([POINTS_RAS[1:], POINTS_RAS + 2.0]), negative=POINTS_RAS + 3.0)
    np.testing.assert_array_equal(points_against([a, b], 0), np.concatenate([POINTS_RAS[:1] + 1.0, POINTS_RAS + 2.0]))
    np.testing.assert_array_equal(points_against([a, b], 1), np.concatenate([POINTS_RAS + 3.0, POINTS_RAS[:1]]))
    assert points_against([ClassRequest("c", POINTS_RAS)], 0).shape == (0, 3)


def test_a_zero_with_a_sign_is_the_same_place() -> None:
    without, signed = np.array([[0.0, 1.0, 0.0]]), np.array([[-0.0, 1.0, -0.0]])
    assert ClassRequest("a", without) == ClassRequest("a", signed)
    assert len(different_places(ClassRequest("a", np.concatenate([without, signed])).positive)) == 1


def test_each_place_counts_once_where_it_comes_first() -> None:
    points = np.array([[2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 1e-12], [1.0, 0.0, 0.0]])
    assert different_places(points).tolist() == [0, 1, 3]
    assert different_places(points[:0]).tolist() == []
