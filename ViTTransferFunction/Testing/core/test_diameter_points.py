"""Points along a diameter, and beyond its ends."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.diameter_points import LEAST_BEYOND_MM, last_diameter, points_of_diameter
from ViTTransferFunction.Logic.core.errors import InputError

START_RAS = np.array([30.0, -80.0, 900.0])
ALONG = np.array([2.0, 1.0, -2.0]) / 3.0
"""An oblique direction of unit length."""


def diameter(length_mm: float) -> np.ndarray:
    return np.stack([START_RAS, START_RAS + length_mm * ALONG])


def along_mm(points_ras: np.ndarray) -> np.ndarray:
    """How far along the line points on it lie; they have to be on it."""
    places: np.ndarray = (points_ras - START_RAS) @ ALONG
    np.testing.assert_allclose(points_ras, START_RAS + places[:, None] * ALONG, atol=1e-9)
    return places


def test_points_lie_along_the_line_the_middle_first_and_beyond_both_ends() -> None:
    inside, outside = points_of_diameter(diameter(50.0))
    np.testing.assert_allclose(along_mm(inside), [25.0, 12.5, 37.5])
    np.testing.assert_allclose(along_mm(outside), [-10.0, 60.0])


def test_a_short_line_keeps_a_distance_of_voxels_to_what_is_outside() -> None:
    _, outside = points_of_diameter(diameter(4.0))
    np.testing.assert_allclose(along_mm(outside), [-LEAST_BEYOND_MM, 4.0 + LEAST_BEYOND_MM])


def test_drawn_the_other_way_round_it_stands_for_the_same_places() -> None:
    forth, back = points_of_diameter(diameter(50.0)), points_of_diameter(diameter(50.0)[::-1])
    for one, other in zip(forth, back, strict=True):
        np.testing.assert_allclose(sorted(along_mm(one)), sorted(along_mm(other)))


@pytest.mark.parametrize("length_mm", [0.0, 0.4, np.nan])
def test_a_line_across_nothing_is_refused_and_the_user_is_told_what_to_do(length_mm: float) -> None:
    with pytest.raises(InputError, match=r"mm long; at least 0\.5 mm were expected\. Drag from one edge"):
        points_of_diameter(diameter(length_mm))


@pytest.mark.parametrize("length_mm", [0.6, 4.0, 50.0])
def test_a_diameter_is_found_among_points_before_and_after_it(length_mm: float) -> None:
    inside, outside = points_of_diameter(diameter(length_mm))
    clicked = START_RAS + np.array([[7.0, 8.0, 9.0], [-3.0, 4.0, 1.0]])
    # As rounded as below a transform.
    inside, outside = np.concatenate([clicked, inside + 1e-6, clicked]), np.concatenate([clicked[1:], outside, clicked])
    found = last_diameter(inside, outside)
    assert found is not None
    assert found.length_mm == pytest.approx(length_mm, abs=1e-4)
    assert (found.inside_until, found.outside_until) == (5, 3)


def test_of_two_diameters_the_last_one_counts() -> None:
    (inside, outside), (more_inside, more_outside) = (points_of_diameter(diameter(length_mm)) for length_mm in (50.0, 20.0))
    found = last_diameter(np.concatenate([inside, more_inside]), np.concatenate([outside, more_outside]))
    assert found is not None
    assert (found.inside_until, found.outside_until) == (6, 4)
    assert found.length_mm == pytest.approx(20.0)


def test_points_are_no_diameter_once_one_is_elsewhere_or_gone() -> None:
    inside, outside = points_of_diameter(diameter(20.0))
    for index in range(3):
        assert last_diameter(inside + 0.1 * np.eye(3)[[index]].T, outside) is None
        assert last_diameter(np.delete(inside, index, axis=0), outside) is None
    for index in range(2):
        assert last_diameter(inside, outside + 0.1 * np.eye(2)[[index]].T) is None
        assert last_diameter(inside, np.delete(outside, index, axis=0)) is None
    assert last_diameter(inside, outside[::-1]) is None
    assert last_diameter(np.empty((0, 3)), np.empty((0, 3))) is None
    assert last_diameter(np.repeat(inside[:1], 3, axis=0), np.repeat(inside[:1], 2, axis=0)) is None
