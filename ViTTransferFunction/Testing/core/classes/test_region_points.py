"""Points inside an outline or a box, and around an outline."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.diameter_points import LEAST_BEYOND_MM
from ViTTransferFunction.Logic.core.classes.region_points import (
    CLOSEST_MM,
    MOST_AROUND,
    MOST_POINTS,
    points_of_outline,
    points_within_box,
    points_within_outline,
)
from ViTTransferFunction.Logic.core.system.errors import InputError

OBLIQUE = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.0, 1.0, -1.0], [2.0, 0.0, 1.0]]))[0]
"""Three orthogonal axes of which none is the patient's."""
AWAY_RAS = np.array([120.0, -80.0, 900.0])


def in_patient(outline: np.ndarray) -> np.ndarray:
    """An outline (N, 2), millimetres, in an oblique plane far from the origin."""
    return AWAY_RAS + outline @ OBLIQUE[:2]


def in_plane(points_ras: np.ndarray) -> np.ndarray:
    """The way back, (M, 3); the last number is the distance from the plane."""
    return (points_ras - AWAY_RAS) @ OBLIQUE.T


def circle(radius_mm: float, count: int = 60, turns: float = 1.0) -> np.ndarray:
    angles = np.linspace(0.0, 2.0 * np.pi * turns, count, endpoint=False)
    return radius_mm * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def test_points_lie_well_inside_in_the_outlines_plane_and_far_from_each_other() -> None:
    points = in_plane(points_within_outline(in_patient(circle(30.0)), 1.0))
    assert len(points) == MOST_POINTS
    np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-9)
    assert np.linalg.norm(points[:, :2], axis=1).max() <= 20.5
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    # Seven on a circle of 20 mm and one in its middle are 17 mm apart at best.
    assert distances[np.triu_indices(MOST_POINTS, 1)].min() > 11.0


def test_a_small_region_has_fewer_points_and_at_least_one() -> None:
    small = points_within_outline(in_patient(circle(6.0)), 1.0)
    assert 1 < len(small) < MOST_POINTS
    assert np.linalg.norm(np.diff(small, axis=0), axis=1).min() >= CLOSEST_MM
    assert len(points_within_outline(in_patient(circle(1.0)), 1.0)) == 1


def test_a_crescent_has_points_in_both_horns_and_none_in_its_hollow() -> None:
    outer, inner = circle(30.0), circle(22.0) + np.array([12.0, 0.0])
    crescent = np.concatenate([outer[8:-7], inner[8:-7][::-1]])
    points = in_plane(points_within_outline(in_patient(crescent), 1.0))[:, :2]
    assert (np.linalg.norm(points - [12.0, 0.0], axis=1) > 22.0).all()
    assert (np.linalg.norm(points, axis=1) < 30.0).all()
    assert points[:, 1].min() < -10.0
    assert points[:, 1].max() > 10.0


def test_a_lasso_that_goes_around_twice_is_full() -> None:
    once, twice = (points_within_outline(in_patient(circle(30.0, 120, turns)), 1.0) for turns in (1.0, 1.9))
    assert len(twice) == len(once)
    assert np.linalg.norm(in_plane(twice)[:, :2], axis=1).min() < 5.0


@pytest.mark.parametrize("box", [(40.0, 20.0), (200.0, 3.0)])
def test_the_points_of_a_rectangle_are_in_it_whatever_its_shape(box: tuple[float, float]) -> None:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * box
    points = in_plane(points_within_outline(in_patient(corners), 1.0))[:, :2]
    assert ((points > 0.0) & (points < np.array(box))).all()
    assert np.ptp(points[:, 0]) > 0.6 * box[0]


@pytest.mark.parametrize("size_mm", [(80.0, 40.0, 30.0), (100.0, 2.0, 2.0), (3.0, 3.0, 3.0)])
def test_the_points_of_a_box_keep_from_its_faces_and_reach_to_its_ends(size_mm: tuple[float, float, float]) -> None:
    box_to_ras = np.eye(4)
    box_to_ras[:3, :3], box_to_ras[:3, 3] = OBLIQUE.T, AWAY_RAS
    in_box = in_plane(points_within_box(box_to_ras, np.array(size_mm), 1.0))
    assert 1 <= len(in_box) <= MOST_POINTS
    assert (0.5 * np.array(size_mm) - np.abs(in_box)).min() >= min(size_mm) / 7.0
    assert np.ptp(in_box[:, 0]) > 0.6 * size_mm[0] or len(in_box) == 1


def test_an_outline_is_points_inside_the_deepest_first_and_all_around_a_fifth_of_its_width_away() -> None:
    inside, outside = map(in_plane, points_of_outline(in_patient(circle(30.0)), 1.0))
    np.testing.assert_allclose(inside, in_plane(points_within_outline(in_patient(circle(30.0)), 1.0)))
    assert np.linalg.norm(inside[0]) < 3.0
    assert len(outside) == MOST_AROUND
    np.testing.assert_allclose(outside[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(outside, axis=1), 30.0 + 0.2 * 60.0, atol=0.5)
    # Evenly, a sixth of the circle apart.
    angles = np.sort(np.arctan2(outside[:, 1], outside[:, 0]))
    assert np.diff(angles, append=angles[0] + 2.0 * np.pi).max() < 1.7


def test_around_a_small_outline_points_keep_a_distance_of_voxels() -> None:
    inside, outside = map(in_plane, points_of_outline(in_patient(circle(2.0)), 1.0))
    assert len(inside) == 1
    np.testing.assert_allclose(np.linalg.norm(outside, axis=1), 2.0 + LEAST_BEYOND_MM, atol=0.1)


def test_around_a_long_outline_points_are_as_near_as_it_is_narrow() -> None:
    corners = np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 20.0], [0.0, 20.0]])
    _, outside = map(in_plane, points_of_outline(in_patient(corners), 1.0))
    beyond = np.maximum(np.abs(outside[:, :2] - [100.0, 10.0]) - [100.0, 10.0], 0.0)
    np.testing.assert_allclose(np.linalg.norm(beyond, axis=1), 0.2 * 20.0, atol=0.5)
    assert np.ptp(outside[:, 0]) > 150.0


@pytest.mark.parametrize("hollow_mm", [60.0, 5.0])
def test_in_a_hollow_no_point_is_nearer_to_the_structure_than_around_it(hollow_mm: float) -> None:
    # Two bars of 20 mm, joined at one end.
    u = [
        (0, 0),
        (120, 0),
        (120, 20),
        (20, 20),
        (20, 20 + hollow_mm),
        (120, 20 + hollow_mm),
        (120, 40 + hollow_mm),
        (0, 40 + hollow_mm),
    ]
    _, outside = map(in_plane, points_of_outline(in_patient(np.array(u, dtype=float)), 1.0))
    in_hollow = (outside[:, 0] > 20.0) & (outside[:, 0] < 120.0) & (outside[:, 1] > 20.0) & (outside[:, 1] < 20.0 + hollow_mm)
    depth = np.minimum(outside[in_hollow, 1] - 20.0, 20.0 + hollow_mm - outside[in_hollow, 1])
    assert (depth >= 3.9).all()
    assert in_hollow.any() == (hollow_mm > 10.0)


def test_drawn_the_other_way_round_an_outline_stands_for_the_same() -> None:
    forth, back = points_of_outline(in_patient(circle(30.0)), 1.0), points_of_outline(in_patient(circle(30.0)[::-1]), 1.0)
    for one, other in zip(forth, back, strict=True):
        assert len(one) == len(other)
        np.testing.assert_allclose(
            np.linalg.norm(in_plane(one), axis=1).max(), np.linalg.norm(in_plane(other), axis=1).max(), atol=1.0
        )


def test_an_outline_that_crosses_itself_is_taken_as_it_encloses() -> None:
    eight = np.stack([30.0 * np.sin(np.linspace(0, 2 * np.pi, 80)), 15.0 * np.sin(np.linspace(0, 4 * np.pi, 80))], axis=1)
    inside, outside = map(in_plane, points_of_outline(in_patient(eight), 1.0))
    assert (inside[:, 0] > 5.0).any()
    assert (inside[:, 0] < -5.0).any()
    assert len(outside) > 2


NOTHING = [np.zeros((1, 2)), np.zeros((5, 2)), np.array([[0.0, 0.0], [10.0, 10.0], [20.0, 20.0]])]


@pytest.mark.parametrize("outline", NOTHING)
def test_an_outline_without_an_area_has_no_points(outline: np.ndarray) -> None:
    assert points_within_outline(in_patient(outline), 1.0).shape == (0, 3)
    with pytest.raises(InputError, match=r"encloses nothing\. Drag once around the structure"):
        points_of_outline(in_patient(outline), 1.0)


@pytest.mark.parametrize("scale", [1 / 8, 1 / 32])
@pytest.mark.parametrize("radius_mm", [2.0, 6.0, 30.0])
def test_of_a_small_specimen_a_drawn_shape_stands_for_the_same_places_as_of_a_body(radius_mm: float, scale: float) -> None:
    # By powers of two, and lopsided: else rounding would decide which of several places that are equally far is first.
    outline = in_patient(circle(radius_mm) * np.linspace(1.0, 1.3, 60)[:, None])
    size_mm = radius_mm * np.array([2.0, 2.1, 4.0])
    for small, large in (
        (points_within_outline(scale * outline, scale), points_within_outline(outline, 1.0)),
        (points_within_box(np.eye(4), scale * size_mm, scale), points_within_box(np.eye(4), size_mm, 1.0)),
        *zip(points_of_outline(scale * outline, scale), points_of_outline(outline, 1.0), strict=True),
    ):
        np.testing.assert_allclose(small, scale * large, atol=1e-6)
