"""Rows of kernels, and their sums, in either precision."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.similarity import kernel_rows
from ViTTransferFunction.Logic.similarity.kernel_rows import CELLS_OF_BLOCK, KernelRows


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16], ids=str)
@pytest.mark.parametrize("cells", [7, CELLS_OF_BLOCK, 3 * CELLS_OF_BLOCK, 3 * CELLS_OF_BLOCK + 5])
def test_sums_are_those_of_the_rows_that_were_given(monkeypatch: pytest.MonkeyPatch, dtype: torch.dtype, cells: int) -> None:
    monkeypatch.setattr(kernel_rows, "device_precision", lambda device: dtype)
    rng = np.random.default_rng(0)
    background = rng.random((3, cells), dtype=np.float32)
    of_point = {key: rng.random((2, cells), dtype=np.float32) for key in (b"a", b"b", b"c")}
    rows = KernelRows(3, cells)
    for start in range(0, cells, 2 * CELLS_OF_BLOCK):
        rows.put_background(start, background[:, start : start + 2 * CELLS_OF_BLOCK])
    rows.indices([b"a", b"b"], lambda index: of_point[(b"a", b"b")[index]])
    # The second point goes, and another one comes in its place.
    indices = rows.indices([b"a", b"c"], lambda index: of_point[(b"a", b"c")[index]])
    weights = np.zeros((2, rows.count), dtype=np.float32)
    of_background, of_a, of_c = (rng.normal(size=(2, count)).astype(np.float32) for count in (3, 2, 2))
    weights[:, :3], weights[:, indices[0]], weights[:, indices[1]] = of_background, of_a, of_c
    expected = of_background @ background + of_a @ of_point[b"a"] + of_c @ of_point[b"c"]
    sums = rows.weighted(weights)
    assert sums.shape == (2, cells)
    np.testing.assert_allclose(sums, expected, atol=1e-5 if dtype == torch.float32 else 0.1)
    some = np.array([0, cells - 1, cells // 2])
    np.testing.assert_allclose(rows.weighted_at(weights[1], some), sums[1][some], atol=1e-5 if dtype == torch.float32 else 0.1)
