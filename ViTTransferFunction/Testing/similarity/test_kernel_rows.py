"""Rows of kernels, and their sums."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.similarity.kernel_rows import CELLS_AT_ONCE, FEW_SUMS, POINTS_OF_ROOM, KernelRows


@pytest.mark.parametrize("sums", [1, FEW_SUMS, FEW_SUMS + 3])
@pytest.mark.parametrize("cells", [7, CELLS_AT_ONCE, 3 * CELLS_AT_ONCE, 3 * CELLS_AT_ONCE + 5])
def test_sums_are_those_of_the_rows_that_were_given(cells: int, sums: int) -> None:
    rng = np.random.default_rng(0)
    background = rng.random((3, cells), dtype=np.float32)
    given = {key: rng.random((2, cells), dtype=np.float32) for key in (b"a", b"b", b"c")}
    of_point = {key: np.stack([kernel, kernel * factors]) for key, (kernel, factors) in given.items()}
    rows = KernelRows(3, cells)
    rows.background[:] = background

    def indices_of(keys: Sequence[bytes]) -> np.ndarray:
        def write(index: int, row: np.ndarray) -> np.ndarray:
            row[:], factors = given[keys[index]]
            return factors

        return rows.indices(keys, write)

    indices_of([b"a", b"b"])
    # The second point goes, and another one comes in its place.
    indices = indices_of([b"a", b"c"])
    weights = np.zeros((sums, rows.count), dtype=np.float32)
    of_background, of_a, of_c = (rng.normal(size=(sums, count)).astype(np.float32) for count in (3, 2, 2))
    weights[:, :3], weights[:, indices[0]], weights[:, indices[1]] = of_background, of_a, of_c
    expected = of_background @ background + of_a @ of_point[b"a"] + of_c @ of_point[b"c"]
    found = rows.weighted(weights)
    assert found.shape == (sums, cells)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    some = np.array([0, cells - 1, cells // 2])
    np.testing.assert_allclose(rows.weighted_at(weights[-1], some), expected[-1][some], atol=1e-5)


def random_rows(cells: int, points: int) -> tuple[KernelRows, np.ndarray, np.ndarray]:
    """Rows of points alone, which of them are whose (points, 2), and the rows (count, cells)."""
    rng = np.random.default_rng(0)
    rows = KernelRows(0, cells)

    def write(_: int, row: np.ndarray) -> np.ndarray:
        row[:] = rng.random(cells)
        return rng.random(cells, dtype=np.float32)

    indices = rows.indices([bytes([number]) for number in range(points)], write)
    each = np.eye(rows.count, dtype=np.float32)[indices.ravel()]
    return rows, indices, rows.weighted(each).reshape(points, 2, cells)


def test_a_second_row_that_was_added_to_the_first_need_not_be_read() -> None:
    rows, indices, before = random_rows(300, 3)
    rows.add_second(b"\x01", 0.25)
    rows.add_second(b"\x01", 3.0)
    np.testing.assert_array_equal(rows.added([b"\x00", b"\x01", b"\x02"]), [0.0, 3.0, 0.0])
    weights = np.zeros((1, rows.count), dtype=np.float32)
    weights[0, indices[:, 0]] = 2.0
    expected = 2.0 * (before[0, 0] + before[1, 0] + 3.0 * before[1, 1] + before[2, 0])
    np.testing.assert_allclose(rows.weighted(weights)[0], expected, rtol=1e-6)


def test_a_point_that_comes_again_has_nothing_added() -> None:
    rows, _, _ = random_rows(5, 1)
    rows.add_second(b"\x00", 2.0)
    rows.indices([], lambda _, row: row)
    rows.indices([b"\x00"], lambda _, row: row)
    assert rows.added([b"\x00"]).tolist() == [0.0]


def test_memory_of_points_that_are_gone_is_given_back_but_for_what_holds_another() -> None:
    rows, _, each = random_rows(5, 2 * POINTS_OF_ROOM + 1)
    for left, rooms in (([0, POINTS_OF_ROOM], 2), ([0], 1), ([], 0)):
        indices = rows.indices([bytes([number]) for number in left], lambda _, row: row)
        assert rows.count == 2 * POINTS_OF_ROOM * rooms
        own = rows.weighted(np.eye(rows.count, dtype=np.float32)[indices.ravel()])
        np.testing.assert_array_equal(own, each[left].reshape(-1, 5))


@pytest.mark.parametrize("used", [[], [0], [63], [0, 1, 2, 4, 7, 20, 63, 64, 69], range(70)])
def test_rows_that_do_not_count_are_in_no_sum_wherever_they_are(used: Sequence[int]) -> None:
    rows, indices, each = random_rows(40, 70)
    some = np.array(used, dtype=int)
    weights = np.zeros((FEW_SUMS + 1, rows.count), dtype=np.float32)
    weights[1, indices[some, 0]], weights[1, indices[some[::2], 1]] = 0.5, -2.0
    expected = 0.5 * each[some, 0].sum(axis=0) - 2.0 * each[some[::2], 1].sum(axis=0)
    for sums in (slice(1, 2), slice(None)):
        found = rows.weighted(weights[sums])
        np.testing.assert_allclose(found.sum(axis=0), expected, atol=1e-4)


def test_the_same_sums_have_the_same_bits() -> None:
    rows, _, _ = random_rows(5000, 40)
    weights = np.random.default_rng(1).normal(size=(1, rows.count)).astype(np.float32)
    weights[:, 40:64] = weights[:, 104:] = 0.0
    np.testing.assert_array_equal(rows.weighted(weights), rows.weighted(weights))


def test_what_the_memory_held_before_is_in_no_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "empty", lambda shape: torch.full(shape, torch.nan))
    rows = KernelRows(1, 5)
    rows.background[:] = 2.0

    def write(_: int, row: np.ndarray) -> np.ndarray:
        row[:] = 2.0
        return row.copy()

    keys = [bytes([number]) for number in range(POINTS_OF_ROOM + 1)]
    rows.indices(keys, write)
    # All but the last one, which is in the second room, are gone.
    ((first, second),) = rows.indices(keys[-1:], write).tolist()
    weights = np.zeros((1, rows.count), dtype=np.float32)
    weights[0, [first, second]] = 1.0
    np.testing.assert_array_equal(rows.weighted(weights), np.full((1, 5), 6.0))
