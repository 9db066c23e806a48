"""What closed outlines go around, and how far it is to them."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.outlines import distance_to, evenly, winding

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


def a_scribble(seed: int) -> np.ndarray:
    """(7, 2), which mostly crosses itself."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (7, 2))


@pytest.mark.parametrize("outline", [SQUARE, SQUARE[::-1], np.tile(SQUARE, (2, 1)), *map(a_scribble, range(5))])
def test_an_outline_goes_around_a_point_as_often_as_its_corners_turn_about_it(outline: np.ndarray) -> None:
    points = np.random.default_rng(9).uniform(outline.min() - 0.5, outline.max() + 0.5, (400, 2))
    x, y = (outline - points[:, None]).transpose(2, 0, 1)
    directions = np.angle(x + 1j * y)
    turns = np.angle(np.exp(1j * (np.roll(directions, -1, axis=1) - directions)))
    np.testing.assert_array_equal(winding(points, outline), np.rint(turns.sum(axis=1) / (2.0 * np.pi)))


@pytest.mark.parametrize("outline", [SQUARE, a_scribble(0), a_scribble(1)])
def test_the_distance_is_that_to_the_nearest_place_on_any_side(outline: np.ndarray) -> None:
    points = np.random.default_rng(9).uniform(-2.0, 5.0, (200, 2))
    shares = np.linspace(0.0, 1.0, 2001)[:, None, None]
    on_sides = (outline + shares * (np.roll(outline, -1, axis=0) - outline)).reshape(-1, 2)
    nearest = [np.linalg.norm(on_sides - point, axis=1).min() for point in points]
    np.testing.assert_allclose(distance_to(points, outline), nearest, atol=2e-3)


def test_corners_become_even_all_around_however_slowly_parts_were_drawn() -> None:
    slow = np.concatenate([np.linspace([0.0, 0.0], [4.0, 0.0], 50), SQUARE[2:]])
    corners = evenly(slow)
    np.testing.assert_allclose(corners, evenly(SQUARE), atol=1e-9)
    steps = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    np.testing.assert_allclose(steps, 16.0 / len(corners))
