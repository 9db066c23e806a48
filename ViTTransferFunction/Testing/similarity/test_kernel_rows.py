"""Rows of kernels, and their sums."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.similarity.kernel_rows import CELLS_AT_ONCE, FEW_SUMS, ROWS_OF_ROOM, KernelRows


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


def test_what_the_memory_held_before_is_in_no_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "empty", lambda shape: torch.full(shape, torch.nan))
    rows = KernelRows(1, 5)
    rows.background[:] = 2.0

    def write(_: int, row: np.ndarray) -> np.ndarray:
        row[:] = 2.0
        return row.copy()

    keys = [bytes([number]) for number in range(ROWS_OF_ROOM)]
    rows.indices(keys, write)
    # All but the last one, which is in the second room, are gone.
    ((first, second),) = rows.indices(keys[-1:], write).tolist()
    weights = np.zeros((1, rows.count), dtype=np.float32)
    weights[0, [first, second]] = 1.0
    np.testing.assert_array_equal(rows.weighted(weights), np.full((1, 5), 6.0))
