"""Work that takes longer than an event loop may stand still, done in short steps between which the loop goes on."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from typing import Generic, TypeVar

from ..system.progress import Between, nothing_between
from .geometry import Box

Result = TypeVar("Result")

Steps = Generator[int, None, Result]
"""Work that stops after each short step, tells how many voxels the step was about, and returns its result in the end."""

ADVANCE_S = 0.015
"""How long an event loop may stand still at a time: less than one picture of a view that is being scrolled through."""
STEP_VOXELS = 1 << 20
"""Voxels of a step: a few milliseconds of numpy's time, so that the voxels of one step stay in the processor's cache."""


class SteppedWork(Generic[Result]):
    """Steps that are taken for a while at a time.

    Args:
        steps: the work.

    Attributes:
        done: voxels that the steps so far were about.
        result: None until it is finished.
    """

    def __init__(self, steps: Steps[Result]) -> None:
        self._steps = steps
        self.done = 0
        self.result: Result | None = None

    def advance(self, seconds: float | None = None) -> bool:
        """Take steps until that much time has passed (`ADVANCE_S`), at least one; returns whether the work is finished.

        Raises whatever the work raises; it is over then.
        """
        until = time.perf_counter() + (ADVANCE_S if seconds is None else seconds)
        while True:
            try:
                self.done += next(self._steps)
            except StopIteration as end:
                self.result = end.value
                return True
            if time.perf_counter() >= until:
                return False


def finished(steps: Steps[Result], between: Between = nothing_between) -> Result:
    """Take all steps at once, where no event loop waits; `between` is called after each, and may raise `Cancelled`."""
    work = SteppedWork(steps)
    while not work.advance(0.0):
        between()
    return work.result  # type: ignore[return-value]


def slabs(box: Box, voxels: int = STEP_VOXELS) -> Iterator[Box]:
    """A box in parts of consecutive slices k, or of consecutive rows j of one, each of about so many voxels, in order."""
    k, j, i = box
    row = max(i.stop - i.start, 1)
    slice_ = row * max(j.stop - j.start, 1)
    thickness, height = max(voxels // slice_, 1), max(voxels // row, 1) if slice_ > voxels else j.stop - j.start
    for start in range(k.start, k.stop, thickness):
        part = slice(start, min(start + thickness, k.stop))
        for first in range(j.start, j.stop, max(height, 1)):
            yield part, slice(first, min(first + height, j.stop)), i
