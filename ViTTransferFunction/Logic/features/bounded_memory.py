"""A network that makes do with the memory there is: fewer slices at once."""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..core.system.errors import InputError
from ..core.system.out_of_memory import is_out_of_memory
from .buffer_pool import BufferPool

if TYPE_CHECKING:
    from torch import Tensor

    from .packed_slices import PatchTokens
    from .vision_transformer import VisionTransformer

logger = logging.getLogger(__name__)


class BoundedMemory:
    """Runs a network on slices, on as many at once as fit; in each of the threads that call it.

    Args:
        network: on the device that is wanted.

    Attributes:
        trouble: what had to be given up, as words to follow a progress message; empty where nothing.
    """

    def __init__(self, network: VisionTransformer) -> None:
        self._network = network
        self._own = _OfThread()
        self._at_once: int | None = None
        self.trouble = ""

    def keys_of_tokens(self, slices: Sequence[PatchTokens]) -> Tensor:
        """As `VisionTransformer.keys_of_tokens`.

        Raises:
            InputError: a single slice does not fit into the processor's memory.
            RuntimeError, MemoryError: nor into another device's (`is_out_of_memory`): who chose it can choose the processor.
        """
        import torch

        keys: list[Tensor] = []
        done = 0
        while done < len(slices):
            at_once = min(self._at_once or len(slices), len(slices) - done)
            try:
                keys.append(self._network.keys_of_tokens(slices[done : done + at_once], self._own.buffers))
                done += at_once
            except (RuntimeError, MemoryError) as error:
                if not is_out_of_memory(error):
                    raise
                self._give_up_something(at_once, error)
        return torch.cat(keys)

    def _give_up_something(self, at_once: int, error: Exception) -> None:
        self._own = _OfThread()
        if at_once > 1:
            self._at_once = at_once // 2
            self.trouble = f" (little memory: {self._at_once} slices at once)"
            logger.warning("Out of memory on %s%s", self._network.device, self.trouble)
        elif self._network.device.type != "cpu":
            raise error
        else:
            raise InputError(
                f"There is too little memory to compute features, even slice by slice ({error}). "
                "Close other programs, choose a faster preset or a smaller grid, or crop the volume to what you need."
            ) from error


class _OfThread(threading.local):
    """What each thread has of its own."""

    def __init__(self) -> None:
        self.buffers = BufferPool()
