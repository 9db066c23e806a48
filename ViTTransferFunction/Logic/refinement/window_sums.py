"""Sums over windows and blocks of a volume, axis by axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor


def window_sums(values: Tensor, reach: int) -> Tensor:
    """Sums over the (2 reach + 1)³ elements around each one; beyond the borders are zeros. (…, K, J, I) to the same shape."""
    for axis in (-3, -2, -1):
        sums = values.clone()
        n = values.shape[axis]
        for step in range(1, min(reach, n - 1) + 1):
            sums.narrow(axis, step, n - step).add_(values.narrow(axis, 0, n - step))
            sums.narrow(axis, 0, n - step).add_(values.narrow(axis, step, n - step))
        values = sums
    return values


def block_sums(values: Tensor, edges: Sequence[int]) -> Tensor:
    """Sums over blocks of `edges` (K, J, I) elements, the last ones perhaps incomplete. (…, K, J, I) to (…, K', J', I')."""
    from torch.nn.functional import pad

    shape = values.shape[-3:]
    missing_k, missing_j, missing_i = (-n % edge for n, edge in zip(shape, edges, strict=True))
    values = pad(values, (0, missing_i, 0, missing_j, 0, missing_k))
    for axis, edge in zip((-3, -2, -1), edges, strict=True):
        # Sums of strided views: many times faster than a sum over a short axis.
        along = values.movedim(axis, -1)
        sums = along[..., 0::edge].clone()
        for offset in range(1, edge):
            sums += along[..., offset::edge]
        values = sums.movedim(-1, axis)
    return values
