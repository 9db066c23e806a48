"""How much of each voxel's neighbourhood is inside a mask: G * m, for a mask m and a Gaussian G with σ of one voxel.

G is approximated by binomial coefficients (`WEIGHTS` along each axis), so that all sums are integers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.torch_arrays import array_of, tensor_of

if TYPE_CHECKING:
    from torch import Tensor

    from .workers import Workers

WEIGHTS = (1, 4, 6, 4, 1)
"""G along each axis, times 16."""
REACH = len(WEIGHTS) // 2
"""How far G reaches along each axis, in voxels to either side."""
WHOLE = sum(WEIGHTS) ** 3
"""The sum of all weights, 4096: the result where a neighbourhood is entirely inside the mask."""
_VOXELS_AT_ONCE = 2**17
"""Sums are computed for this many voxels at a time, so that intermediate results stay in the processor's cache."""
_CHANGES_AT_ONCE = 2**12
"""Updates are computed for this many changed voxels at a time; their arrays take 5 MB."""
_VOXELS_PER_CHANGE = 50
"""If more than one in this many voxels has changed, computing all sums again takes no longer than updating them."""


def neighbourhood_sums(mask: Tensor, workers: Workers) -> Tensor:
    """G * m, times `WHOLE`; beyond the faces of the mask, m has the value of the nearest voxel.

    Args:
        mask: (K, J, I) uint8, 0 or 1.
        workers: compute the sums.

    Returns:
        (K, J, I) int16, 0 to `WHOLE`.

    Raises:
        Cancelled: by `workers.between`.
    """
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
    """The sums of a mask after some of its voxels have changed: the result of `neighbourhood_sums`, usually much faster.

    Args:
        sums: (K, J, I) int16, the sums before the change; may be changed in place.
        mask: (K, J, I) uint8, 0 or 1, after the change.
        changed: indices of the voxels that have changed, in the flattened mask, (N,), each once.
        workers: compute all sums again if many voxels have changed.

    Returns:
        (K, J, I) int16, 0 to `WHOLE`: `sums`, or a new tensor.

    Raises:
        Cancelled: by `workers.between`; `sums` may then be updated in part.
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
        # Voxels beyond the mask have a change of 0, so that any index within it will do.
        reached = (changed[some, None] + offsets).clip(0, mask.numel() - 1)
        sums.view(-1).scatter_add_(0, tensor_of(reached.ravel()), tensor_of(changes.ravel()))
    return sums


def _reached(count: int) -> np.ndarray:
    """The weight of each voxel of a row in the sums of the voxels around it.

    Args:
        count: length of the row.

    Returns:
        (count, 2 REACH + 1) int16, by voxel and by the step to the voxel whose sum it is in; 0 where that is beyond the row.
    """
    reached = np.zeros((count, len(WEIGHTS)), dtype=np.int16)
    for step, weight in enumerate(WEIGHTS, start=-REACH):
        of = np.arange(count)
        read = (of + step).clip(0, count - 1)
        np.add.at(reached, (read, of - read + REACH), weight)
    return reached


def _sums_of(mask: Tensor, layers: slice) -> Tensor:
    """The sums in some layers (first axis) of a mask, (layers, J, I) int16."""
    import torch

    sums = mask[torch.arange(layers.start - REACH, layers.stop + REACH).clamp_(0, len(mask) - 1)]
    for axis in (0, 1, 2):
        if axis:
            n = sums.shape[axis]
            sums = sums.index_select(axis, torch.arange(-REACH, n + REACH).clamp_(0, n - 1))
        # The sums along the first axis, up to 16, fit into uint8; the others do not.
        sums = _sums_along(sums, axis).to(torch.int16)
    return sums


def _sums_along(values: Tensor, axis: int) -> Tensor:
    """Weighted sums of five values along an axis, which gets shorter by 2 REACH: only complete sums are returned."""
    n = values.shape[axis] - 2 * REACH
    first, second, middle, fourth, last = (values.narrow(axis, start, n) for start in range(2 * REACH + 1))
    return (first + last).add_(second + fourth, alpha=WEIGHTS[1]).add_(middle, alpha=WEIGHTS[2])
