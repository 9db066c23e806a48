"""A network that makes do with the memory there is: fewer slices at once."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..core.system.errors import InputError
from ..core.system.out_of_memory import is_out_of_memory
from ..core.system.progress import Between, nothing_between
from .buffer_pool import BufferPool

if TYPE_CHECKING:
    from torch import Tensor

    from .packed_slices import PatchTokens
    from .vision_transformer import VisionTransformer

logger = logging.getLogger(__name__)


class BoundedMemory:
    """Runs a network on slices, on as many at once as fit; in each of the threads that call it, or in one after the other.

    Args:
        network: on the device that is wanted.

    Attributes:
        trouble: what had to be given up, as words to follow a progress message; empty where nothing.
    """

    def __init__(self, network: VisionTransformer) -> None:
        self._network = network
        self._own = _OfThread()
        self._at_once: int | None = None
        self._in_turn = False
        self._running, self._changed = 0, threading.Condition()
        self.trouble = ""

    def keys_of_tokens(self, slices: Sequence[PatchTokens], between: Between = nothing_between) -> Tensor:
        """As `VisionTransformer.keys_of_tokens`.

        Raises:
            InputError: a single slice does not fit into the processor's memory, even while no other thread has one.
            RuntimeError, MemoryError: nor into another device's (`is_out_of_memory`): who chose it can choose the processor.
        """
        import torch

        keys: list[Tensor] = []
        done = 0
        while done < len(slices):
            at_once = min(self._at_once or len(slices), len(slices) - done)
            with self._turn() as alone:
                try:
                    some = slices[done : done + at_once]
                    # Where threads take turns, none keeps memory from one to the next.
                    keys.append(self._network.keys_of_tokens(some, None if alone else self._own.buffers, between))
                    done += at_once
                except (RuntimeError, MemoryError) as error:
                    if not is_out_of_memory(error):
                        raise
                    self._give_up_something(at_once, alone, error)
        return torch.cat(keys)

    @contextmanager
    def _turn(self) -> Iterator[bool]:
        """Wait until the network may run; gives whether it then does so in no other thread."""
        with self._changed:
            self._changed.wait_for(lambda: not (self._in_turn and self._running))
            self._running += 1
            alone = self._in_turn
        try:
            yield alone
        finally:
            with self._changed:
                self._running -= 1
                self._changed.notify_all()

    def _give_up_something(self, at_once: int, alone: bool, error: Exception) -> None:
        self._own = _OfThread()
        if at_once > 1:
            self._at_once = at_once // 2
        elif self._network.device.type != "cpu":
            raise error
        elif not alone:
            self._in_turn, self._at_once = True, 1
        else:
            raise InputError(
                f"There is too little memory to compute features, even slice by slice ({error}). "
                "Close other programs, choose a faster preset or a smaller grid, or crop the volume to what you need."
            ) from error
        self.trouble = f" (little memory: {self._at_once} slices at once)"
        logger.warning("Out of memory on %s%s", self._network.device, self.trouble)


class _OfThread(threading.local):
    """What each thread has of its own."""

    def __init__(self) -> None:
        self.buffers = BufferPool()
