"""How much of each voxel's neighbourhood is inside a mask: G * m, with G a Gaussian of one voxel, in whole numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.torch_arrays import array_of, tensor_of

if TYPE_CHECKING:
    from torch import Tensor

    from .workers import Workers

WEIGHTS = (1, 4, 6, 4, 1)
"""G along each axis."""
REACH = len(WEIGHTS) // 2
"""Voxels to either side that G reaches."""
WHOLE = sum(WEIGHTS) ** 3
"""The sum of G's weights."""
_VOXELS_AT_ONCE = 2**17
"""So many stay near the processor."""
_CHANGES_AT_ONCE = 2**12
"""So many take five megabytes."""
_VOXELS_PER_CHANGE = 50
"""Where more than one in so many voxels has changed, sums are as soon found anew."""


def neighbourhood_sums(mask: Tensor, workers: Workers) -> Tensor:
    """G * m of a mask (K, J, I) uint8, times `WHOLE`, int16; beyond its faces, m goes on as it is there."""
    import torch

    sums = torch.empty(mask.shape, dtype=torch.int16)

    def find(shares: Sequence[slice]) -> None:
        for layers in shares:
            workers.between()
            sums[layers] = _sums_of(mask, layers)

    count = max(_VOXELS_AT_ONCE // (mask.shape[1] * mask.shape[2]), 1)
    workers.share_out([slice(start, min(start + count, len(mask))) for start in range(0, len(mask), count)], find)
    return sums


def updated_sums(sums: Tensor, mask: Tensor, changed: np.ndarray, workers: Workers) -> Tensor:
    """The sums of a mask of which some voxels have changed: the same as `neighbourhood_sums`, mostly much sooner.

    Args:
        sums: (K, J, I) int16, those before; they are changed.
        mask: (K, J, I) uint8, as it is now.
        changed: (N,) which of its voxels, flattened, were others before.
        workers: that find all sums where many have changed.
    """
    if len(changed) * _VOXELS_PER_CHANGE > mask.numel():
        return neighbourhood_sums(mask, workers)
    steps = np.arange(-REACH, REACH + 1)
    stride_k, stride_j, stride_i = sums.stride()
    offsets = (stride_k * steps[:, None, None] + stride_j * steps[:, None] + stride_i * steps).ravel()
    tables = [_reached(n) for n in mask.shape]
    signs = 2 * array_of(mask.view(-1))[changed].astype(np.int16) - 1
    for start in range(0, len(changed), _CHANGES_AT_ONCE):
        workers.between()
        some = slice(start, start + _CHANGES_AT_ONCE)
        k, j, i = (table[at] for table, at in zip(tables, np.unravel_index(changed[some], mask.shape), strict=True))
        changes = (signs[some, None] * k)[:, :, None, None] * (j[:, :, None] * i[:, None])[:, None]
        # What would lie beyond the mask gets nothing, wherever it is put.
        reached = (changed[some, None] + offsets).clip(0, mask.numel() - 1)
        sums.view(-1).scatter_add_(0, tensor_of(reached.ravel()), tensor_of(changes.ravel()))
    return sums


def _reached(count: int) -> np.ndarray:
    """With which weight each voxel of a row counts for those around it, (count, 2 REACH + 1) int16; 0 beyond the row."""
    reached = np.zeros((count, len(WEIGHTS)), dtype=np.int16)
    for step, weight in enumerate(WEIGHTS, start=-REACH):
        of = np.arange(count)
        read = (of + step).clip(0, count - 1)
        np.add.at(reached, (read, of - read + REACH), weight)
    return reached


def _sums_of(mask: Tensor, layers: slice) -> Tensor:
    """Those of some layers, (layers, J, I)."""
    import torch

    sums = mask[torch.arange(layers.start - REACH, layers.stop + REACH).clamp_(0, len(mask) - 1)]
    for axis in (0, 1, 2):
        if axis:
            n = sums.shape[axis]
            sums = sums.index_select(axis, torch.arange(-REACH, n + REACH).clamp_(0, n - 1))
        # Bytes hold the first axis's sums, up to 16, and no others.
        sums = _sums_along(sums, axis).to(torch.int16)
    return sums


def _sums_along(values: Tensor, axis: int) -> Tensor:
    """Weighted sums along an axis, of which those are left that have all five."""
    n = values.shape[axis] - 2 * REACH
    first, second, middle, fourth, last = (values.narrow(axis, start, n) for start in range(2 * REACH + 1))
    return (first + last).add_(second + fourth, alpha=WEIGHTS[1]).add_(middle, alpha=WEIGHTS[2])
