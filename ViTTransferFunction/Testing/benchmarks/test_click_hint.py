"""Where to click next."""

from __future__ import annotations

import numpy as np

from Benchmarks.hints.click_hint import click_hint
from ViTTransferFunction.Logic.core.class_request import ClassRequest
from ViTTransferFunction.Logic.core.geometry import Geometry

GEOMETRY = Geometry((20, 20, 20), np.array([[2.0, 0, 0, -5], [0, 2.0, 0, 3], [0, 0, 4.0, 8], [0, 0, 0, 1]]))
ISO = 0.3


def at_cells(*cells_kji: tuple[int, int, int]) -> np.ndarray:
    return GEOMETRY.ijk_to_ras_points(np.array(cells_kji, dtype=float).reshape(-1, 3)[:, ::-1])


def a_class(*cells_kji: tuple[int, int, int], refused: tuple[tuple[int, int, int], ...] = ()) -> ClassRequest:
    return ClassRequest("a", at_cells(*cells_kji), negative=at_cells(*refused))


def hinted_cell(similarity: np.ndarray, *classes: ClassRequest) -> tuple[int, ...]:
    hint = click_hint(similarity, ISO, GEOMETRY, classes)
    return tuple(np.round(GEOMETRY.ras_to_ijk(hint)[0, ::-1]).astype(int).tolist())


def test_the_hint_lies_in_the_undecided_region() -> None:
    similarity = np.full(GEOMETRY.shape, 0.01)
    similarity[2:5, 2:5, 2:5] = 0.9
    similarity[12:16, 13:17, 3:7] = ISO
    cell = hinted_cell(similarity, a_class((3, 3, 3)))
    assert 12 <= cell[0] < 16
    assert 13 <= cell[1] < 17
    assert 3 <= cell[2] < 7


def test_the_larger_of_two_undecided_regions_comes_first() -> None:
    similarity = np.full(GEOMETRY.shape, 0.01)
    similarity[3:4, 15:17, 15:17] = ISO
    similarity[14:18, 14:18, 2:6] = ISO
    assert hinted_cell(similarity, a_class((10, 2, 10)))[0] >= 14


def test_what_was_clicked_by_any_class_is_not_asked_again() -> None:
    similarity = np.full(GEOMETRY.shape, 0.01)
    similarity[3:6, 3:6, 3:6] = similarity[14:17, 14:17, 14:17] = ISO
    own, other = a_class((10, 10, 2)), a_class((4, 4, 4))
    assert hinted_cell(similarity, own, other)[0] >= 14
    assert hinted_cell(similarity, a_class((10, 10, 2), refused=((15, 15, 15),)))[0] < 6


def test_flat_maps_have_a_hint_away_from_the_points() -> None:
    for level in (0.0, ISO, 1.0):
        hint = click_hint(np.full(GEOMETRY.shape, level), ISO, GEOMETRY, [a_class((3, 3, 3))])
        assert np.isfinite(hint).all()
        assert np.linalg.norm(hint - at_cells((3, 3, 3))[0]) > 5.0
