"""Which slices the network gets at once."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.features.background_tokens import TokenSelection
from ViTTransferFunction.Logic.features.extraction_plan import PlannedSlice
from ViTTransferFunction.Logic.features.slice_batches import TOKENS_ON_CPU, in_batches, tokens_at_once
from ViTTransferFunction.Logic.features.slice_sampling import SliceSample

CPU = torch.device("cpu")


def slices_of(*tokens: int) -> list[PlannedSlice]:
    chosen = (TokenSelection(np.arange(count), np.ones(count), np.arange(count)) for count in tokens)
    return [PlannedSlice(0, SliceSample(float(number), ()), of_slice) for number, of_slice in enumerate(chosen)]


def test_batches_are_runs_of_slices_up_to_a_number_of_tokens() -> None:
    slices = slices_of(3, 4, 3, 8, 20, 1, 1)
    batches = list(in_batches(slices, 10))
    assert [[len(of_slice.chosen.places) for of_slice in batch] for batch in batches] == [[3, 4, 3], [8], [20], [1, 1]]
    assert [of_slice for batch in batches for of_slice in batch] == slices


def test_no_slices_make_no_batch() -> None:
    assert list(in_batches([], 10)) == []


@pytest.mark.parametrize("threads", [1, 2, 6, 14])
def test_threads_get_several_batches_each(threads: int) -> None:
    tokens = [300] * 70
    batches = list(in_batches(slices_of(*tokens), tokens_at_once(tokens, CPU, threads)))
    assert len(batches) >= 4 * threads


def test_there_is_a_largest_batch_on_a_cpu_and_on_other_devices_one_that_does_not_depend_on_threads() -> None:
    many = [300] * 1000
    assert tokens_at_once(many, CPU, 2) == TOKENS_ON_CPU
    assert tokens_at_once(many, torch.device("cuda"), 1) == tokens_at_once([300], torch.device("cuda"), 16) > TOKENS_ON_CPU
