"""Tables for whole volumes."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.rendering import lookup
from ViTTransferFunction.Logic.rendering.lookup import looked_up


@pytest.mark.parametrize("part_voxels", [1, 50, 10_000])
def test_each_index_finds_its_value(monkeypatch: pytest.MonkeyPatch, part_voxels: int) -> None:
    monkeypatch.setattr(lookup, "PART_VOXELS", part_voxels)
    rng = np.random.default_rng(0)
    table = rng.integers(0, 65536, 256).astype(np.uint16)
    # Every other column, as of a part of a volume.
    indices = rng.integers(0, 256, (7, 9, 22)).astype(np.uint8)[..., ::2]
    found = looked_up(table, indices)
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, table[indices])


def test_where_there_are_no_indices_nothing_is_found() -> None:
    assert looked_up(np.zeros(3), np.zeros((0, 4, 5), dtype=np.uint8)).shape == (0, 4, 5)
