"""Rows of numbers that do not compete for the same places of caches."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Logic.core.volumes.long_rows import long_rows

PAGE_BYTES = 4096


@pytest.mark.parametrize("columns", [1, 300, 1024, 40**3, 64**3])
def test_rows_begin_at_different_places_of_their_pages(columns: int) -> None:
    rows = long_rows(16, columns)
    assert rows.shape == (16, columns)
    assert rows[3].is_contiguous()
    assert len({row.data_ptr() % PAGE_BYTES // 64 for row in rows}) == 16
