"""Which slices the network gets at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from .extraction_plan import PlannedSlice

if TYPE_CHECKING:
    import torch

TOKENS_ON_CPU = 1024
"""In each of the threads: fewer keep the arithmetic less busy, and more do not stay in the processor's cache."""
BATCHES_PER_THREAD = 4
"""At least, where slices are short enough, so that no thread waits long for the others in the end."""
TOKENS_ON_OTHER_DEVICES = 8192
"""Enough to keep them busy; beyond it memory grows and time does not shrink."""


def tokens_at_once(tokens: Sequence[int], device: torch.device, threads: int) -> int:
    """How many tokens a batch has at most, unless a single slice has more.

    Args:
        tokens: of all slices to run.
        device: where they are run.
        threads: how many batches are run at once.
    """
    if device.type != "cpu":
        return TOKENS_ON_OTHER_DEVICES
    return min(TOKENS_ON_CPU, sum(tokens) // (BATCHES_PER_THREAD * threads))


def in_batches(slices: Sequence[PlannedSlice], most_tokens: int) -> Iterator[list[PlannedSlice]]:
    """Runs of consecutive slices with so many tokens at most, or a single slice."""
    batch: list[PlannedSlice] = []
    tokens = 0
    for of_slice in slices:
        length = len(of_slice.chosen.places)
        if batch and tokens + length > most_tokens:
            yield batch
            batch, tokens = [], 0
        batch.append(of_slice)
        tokens += length
    if batch:
        yield batch
