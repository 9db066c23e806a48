"""Keys of slices across three axes, summed as they arrive and averaged in the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
        self._weights = [np.zeros(layers, dtype=np.float32) for layers in shape]

    def add(self, axis: int, sample: SliceSample, keys: Tensor) -> None:
        """Add the keys (rows, columns, C) of a slice across `axis` to the layers that it contributes to."""
        # Rounded as the features will be, three of them add up exactly in float32: in whatever order they come.
        rounded = keys.to(self._sums.device).half().float()
        for layer, weight in sample.layers:
            self._sums.select(axis, layer).add_(rounded, alpha=weight)
            self._weights[axis][layer] += weight

    def mean(self) -> Tensor:
        """Features (…, …, …, C) float16 on the processor, once every slice was added."""
        import torch

        # Layer by layer, so that there is no second float32 volume.
        return torch.stack([(layer / 3.0).half().cpu() for layer in self._sums])

    def mean_with(self, others: Tensor) -> Tensor:
        """As `mean`, where slices not yet added are stood in for by other features (…, …, …, C) of the same cells."""
        import torch

        first, second, third = (torch.from_numpy(weights).to(self._sums.device) for weights in self._weights)
        across = (second[:, None] + third)[..., None]
        layers = []
        for layer, other, weight in zip(self._sums, others, first, strict=True):
            missing = (3.0 - weight - across).clamp(min=0.0)
            layers.append(((layer + missing * other.to(layer)) / 3.0).half().cpu())
        return torch.stack(layers)


def interpolated(features: Tensor, shape: tuple[int, int, int]) -> Tensor:
    """Features (K, J, I, C) interpolated trilinearly to another `shape` of cells that fill the same box; float16."""
    import torch
    from torch.nn.functional import interpolate

    if tuple(features.shape[:3]) == shape:
        return features
    fine = torch.empty((*shape, features.shape[3]), dtype=torch.float16)
    last = len(features) - 1
    for k, plane in enumerate(fine):
        position = min(max((k + 0.5) * len(features) / shape[0] - 0.5, 0.0), float(last))
        lower = int(position)
        between = torch.lerp(features[lower].float(), features[min(lower + 1, last)].float(), position - lower)
        resized = interpolate(between.permute(2, 0, 1)[None], size=shape[1:], mode="bilinear", align_corners=False)
        plane.copy_(resized[0].permute(1, 2, 0))
    return fine
