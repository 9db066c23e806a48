"""Keys of slices across three axes, summed as they arrive and averaged in the end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from .slice_sampling import SliceSample

if TYPE_CHECKING:
    import torch
    from torch import Tensor


class FeatureSums:
    """Sums over the three axes' slices on one grid of patches.

    Args:
        shape: patches along the three axes.
        channels: of the keys.
        device: where to keep the sums.
    """

    def __init__(self, shape: tuple[int, int, int], channels: int, device: torch.device) -> None:
        import torch

        self._sums = torch.zeros((*shape, channels), dtype=torch.float32, device=device)

    def add(self, axis: int, sample: SliceSample, keys: Tensor) -> None:
        """Add the keys (rows, columns, C) of a slice across `axis` to the layers that it contributes to."""
        # Rounded as the features will be, all but one in some ten thousand add up exactly in float32, with weights of 1 and ½.
        rounded = keys.to(self._sums.device).half().float()
        for layer, weight in sample.layers:
            self._sums.select(axis, layer).add_(rounded, alpha=weight)

    def means(self) -> Iterator[Tensor]:
        """Layer after layer of the features, (…, …, C) float16 on the processor, once every slice was added."""
        for layer in self._sums:
            yield (layer / 3.0).half().cpu()
