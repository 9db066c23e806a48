"""Learned position embeddings on other grids than that of training."""

from __future__ import annotations

import gc
import sys
import weakref
from collections.abc import Iterator
from typing import Any

import pytest
import torch

from ViTTransferFunction.Logic.core.system.undivided_threads import UndividedThreads
from ViTTransferFunction.Logic.features.last_grids import MOST_GRIDS, LastGrids
from ViTTransferFunction.Logic.features.position_table import PositionTable, interpolate_position_table
from ViTTransferFunction.Testing.support.torch_threads import torch_threads


def test_position_table_of_the_trained_size_is_untouched() -> None:
    table = torch.randn(1, 1 + 25, 8)
    assert interpolate_position_table(table, 5, 5) is table


def test_position_table_keeps_the_class_entry_and_a_constant_grid() -> None:
    table = torch.full((1, 1 + 25, 8), 3.0)
    table[:, 0] = 7.0
    resized = interpolate_position_table(table, 4, 9)
    assert resized.shape == (1, 1 + 36, 8)
    torch.testing.assert_close(resized[:, 0], torch.full((1, 8), 7.0))
    torch.testing.assert_close(resized[:, 1:], torch.full((1, 36, 8), 3.0))


def test_position_table_runs_along_rows_and_columns_as_the_patches_do() -> None:
    rows = torch.arange(5.0).repeat_interleave(5).reshape(1, 25, 1)
    columns = torch.arange(5.0).repeat(5).reshape(1, 25, 1)
    table = torch.cat([torch.zeros(1, 1, 2), torch.cat([rows, columns], dim=2)], dim=1)
    resized = interpolate_position_table(table, 10, 20)[0, 1:].reshape(10, 20, 2)
    assert (resized[1:, :, 0] >= resized[:-1, :, 0] - 1e-4).all()
    assert (resized[:, 1:, 1] >= resized[:, :-1, 1] - 1e-4).all()
    torch.testing.assert_close(resized[:, 0, 0], resized[:, -1, 0], atol=1e-5, rtol=0)


def test_a_table_on_another_device_is_resized_by_the_processor_which_every_pytorch_can() -> None:
    class Elsewhere:
        """A tensor of a device that can hold it, and nothing more."""

        device = torch.device("meta")

        def cpu(self) -> torch.Tensor:
            return torch.randn(1, 1 + 25, 8, dtype=torch.float16)

    table: Any = Elsewhere()
    resized = PositionTable(table, torch.float16).resized(4, 9)
    assert (resized.device.type, resized.dtype, resized.shape) == ("meta", torch.float16, (37, 8))


def test_tables_of_grids_that_are_not_asked_for_any_more_are_let_go() -> None:
    """A program that sees one volume after the other, or one close-up, would hold megabytes more of each."""
    table = PositionTable(torch.randn(1, 1 + 25, 8), torch.float32)
    resized = [weakref.ref(table.resized(rows, 7)) for rows in range(3, 23)]
    gc.collect()
    assert sum(each() is not None for each in resized) <= MOST_GRIDS


def test_every_slice_of_an_axis_gets_the_same_table() -> None:
    table = PositionTable(torch.randn(1, 1 + 25, 8), torch.float32)
    of_axes = [table.resized(*grid) for grid in ((4, 9), (9, 6), (4, 6))]
    assert [table.resized(*grid) is first for grid, first in zip(((4, 9), (9, 6), (4, 6)), of_axes, strict=True)] == [True] * 3


@pytest.fixture
def quick_turns() -> Iterator[None]:
    """Threads take turns at Python's lock all the time."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("quick_turns")
def test_threads_ask_for_more_grids_than_are_kept_without_getting_in_each_others_way() -> None:
    grids = LastGrids()

    def ask(rows: int) -> int:
        return int(grids.of(rows, 7, lambda: torch.tensor(rows)))

    rows = [1 + number % (MOST_GRIDS + 2) for number in range(2000)]
    with torch_threads(4), UndividedThreads(torch.device("cpu")) as threads:
        assert list(threads.results(rows, ask)) == rows
