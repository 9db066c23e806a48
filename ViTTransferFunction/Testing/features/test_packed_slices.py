"""Slices one after the other in one array."""

from __future__ import annotations

import torch
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.packed_slices import BATCH_STEP, SLICE_STEP, PackedSlices, PatchTokens

LENGTHS = st.lists(st.tuples(st.integers(1, 200), st.booleans()), min_size=1, max_size=8)


def packed(lengths: list[tuple[int, bool]], prefix_tokens: int) -> PackedSlices:
    """Slices of so many patches, with or without counts."""
    slices = [
        PatchTokens(torch.empty(length, 3), 20, 10, torch.arange(length), torch.ones(length))
        if counted
        else PatchTokens(torch.empty(length, 3), length, 1)
        for length, counted in lengths
    ]
    return PackedSlices(slices, prefix_tokens)


@given(LENGTHS, st.integers(1, 5))
def test_slices_follow_each_other_and_hold_their_patches(lengths: list[tuple[int, bool]], prefix_tokens: int) -> None:
    layout = packed(lengths, prefix_tokens)
    assert [span.start for span in layout.spans] == [0, *(span.stop for span in layout.spans[:-1])]
    for (length, _), span, patches in zip(lengths, layout.spans, layout.patches, strict=True):
        assert (patches.start, patches.stop) == (span.start + prefix_tokens, span.start + prefix_tokens + length)
        assert patches.stop <= span.stop
    assert layout.spans[-1].stop <= layout.rows


@given(LENGTHS)
def test_there_are_few_different_numbers_of_rows(lengths: list[tuple[int, bool]]) -> None:
    layout = packed(lengths, 1)
    assert layout.rows % BATCH_STEP == 0
    for (length, counted), span in zip(lengths, layout.spans, strict=True):
        rows = span.stop - span.start
        assert rows % SLICE_STEP == 0 if counted else rows == 1 + length
        assert rows < 1 + length + SLICE_STEP


def test_a_workspace_gives_the_same_memory_again() -> None:
    workspace = BufferPool()
    first = workspace.rows("tokens", 700, 8, torch.float32, torch.device("cpu"))
    second = workspace.rows("tokens", 300, 8, torch.float32, torch.device("cpu"))
    assert first.data_ptr() == second.data_ptr()
    assert len(second) == 300


def test_a_workspace_grows_with_what_is_asked_of_it() -> None:
    workspace = BufferPool()
    workspace.rows("tokens", 10, 8, torch.float32, torch.device("cpu"))
    assert workspace.rows("tokens", 10_000, 8, torch.float32, torch.device("cpu")).shape == (10_000, 8)
