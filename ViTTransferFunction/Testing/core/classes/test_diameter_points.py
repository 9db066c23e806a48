"""Points along a diameter, and beyond its ends."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.diameter_points import LEAST_BEYOND_MM, points_of_diameter
from ViTTransferFunction.Logic.core.system.errors import InputError

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
    inside, outside = points_of_diameter(diameter(50.0), 1.0)
    np.testing.assert_allclose(along_mm(inside), [25.0, 12.5, 37.5])
    np.testing.assert_allclose(along_mm(outside), [-10.0, 60.0])


def test_a_short_line_keeps_a_distance_of_voxels_to_what_is_outside() -> None:
    _, outside = points_of_diameter(diameter(4.0), 1.0)
    np.testing.assert_allclose(along_mm(outside), [-LEAST_BEYOND_MM, 4.0 + LEAST_BEYOND_MM])


def test_drawn_the_other_way_round_it_stands_for_the_same_places() -> None:
    forth, back = points_of_diameter(diameter(50.0), 1.0), points_of_diameter(diameter(50.0)[::-1], 1.0)
    for one, other in zip(forth, back, strict=True):
        np.testing.assert_allclose(sorted(along_mm(one)), sorted(along_mm(other)))


@pytest.mark.parametrize("length_mm", [0.0, 0.4, np.nan])
def test_a_line_across_nothing_is_refused_and_the_user_is_told_what_to_do(length_mm: float) -> None:
    with pytest.raises(InputError, match=r"mm long; at least 0\.5 mm were expected\. Drag from one edge"):
        points_of_diameter(diameter(length_mm), 1.0)


@pytest.mark.parametrize("length_mm", [4.0, 50.0])
def test_across_a_small_specimen_a_line_stands_for_the_same_places_as_across_a_body(length_mm: float) -> None:
    of_body, of_specimen = (
        points_of_diameter(diameter(length_mm), 1.0),
        points_of_diameter(diameter(length_mm / 30.0), 1.0 / 30.0),
    )
    for one, other in zip(of_body, of_specimen, strict=True):
        np.testing.assert_allclose(along_mm(other), along_mm(one) / 30.0, atol=1e-9)


def test_what_is_too_short_across_a_body_is_long_enough_across_a_small_specimen_and_the_limit_is_told_as_it_is() -> None:
    points_of_diameter(diameter(0.4), 0.1)
    with pytest.raises(InputError, match=r"is 0\.04 mm long; at least 0\.05 mm were expected"):
        points_of_diameter(diameter(0.04), 0.1)
