"""A few points out of many."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.classes.spread_points import spread_points

POINTS: st.SearchStrategy[np.ndarray] = st.lists(st.tuples(*[st.floats(-50.0, 50.0)] * 3), min_size=1, max_size=40).map(
    np.array
)


def test_the_ends_of_a_line_come_before_its_middle() -> None:
    line = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [9.0, 0.0], [10.0, 0.0]])
    assert spread_points(line, [0], 3, 0.5).tolist() == [0, 4, 2]


def test_all_of_the_first_are_taken_and_further_ones_keep_away_from_each() -> None:
    line = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [9.0, 0.0], [10.0, 0.0]])
    assert spread_points(line, [0, 4], 3, 0.5).tolist() == [0, 4, 2]
    assert spread_points(line, [0, 1, 4], 2, 0.5).tolist() == [0, 1, 4]


@given(POINTS, st.integers(1, 10), st.floats(0.1, 20.0))
def test_no_two_are_nearer_than_allowed_and_every_point_is_near_one_unless_that_takes_too_many(
    points: np.ndarray, most: int, closest_mm: float
) -> None:
    taken = points[spread_points(points, [0], most, closest_mm)]
    distances = np.linalg.norm(taken[:, None] - taken[None], axis=2) + np.diag(np.full(len(taken), np.inf))
    assert 1 <= len(taken) <= most
    assert distances.min() >= closest_mm
    if len(taken) < most:
        assert np.linalg.norm(points[:, None] - taken[None], axis=2).min(axis=1).max() < closest_mm
