"""Rotary positions: attention sees where patches lie, because queries and keys are turned by angles that say it.

Su et al., RoFormer, 2021; Heo et al., Rotary Position Embedding for Vision Transformer, 2024; Siméoni et al., DINOv3, 2025.

A head's D channels are D/2 pairs (x_j, x_{j + D/2}), each turned in its plane by an angle θ_j. The first D/4 pairs turn with
the patch's row, the others with its column (axial), at periods that are part of the weights (100^{4j/D}):

    θ_j = 2π y / period_j,   θ_{j + D/4} = 2π x / period_j,   y = 2 (row + ½) / rows − 1,   x = 2 (column + ½) / columns − 1
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .buffer_pool import BufferPool
from .last_grids import LastGrids
from .packed_slices import PackedSlices, PatchTokens

if TYPE_CHECKING:
    from torch import Tensor


class RotaryPositions:
    """The angles of patches.

    Args:
        periods: (D/4,) of a head with D channels, in halves of a slice's edge.
    """

    def __init__(self, periods: Tensor) -> None:
        # In reduced precision, angles would be off by a hundredth, and neighbours in a large grid be hard to tell apart.
        self._periods = periods.float()
        self._angles = LastGrids()

    def rotations(self, slices: Sequence[PatchTokens], packed: PackedSlices, work: BufferPool) -> tuple[Tensor, Tensor]:
        """Cosines and sines of the angles of all rows, each (R, D/2) float32.

        Every patch is turned by its own place in its slice. Class token, registers and padding are not turned.
        """
        import torch

        channels, device = 2 * len(self._periods), self._periods.device
        angles = work.rows("angles", packed.rows, channels, torch.float32, device).zero_()
        for group, patches in zip(slices, packed.patches, strict=True):
            of_grid = self._of_grid(group.rows, group.columns)
            angles[patches] = of_grid if group.places is None else of_grid[group.places.to(device)]
        cosines = torch.cos(angles, out=work.rows("cosines", packed.rows, channels, torch.float32, device))
        return cosines, angles.sin_()

    def _of_grid(self, rows: int, columns: int) -> Tensor:
        """Angles (rows·columns, D/2)."""
        import torch

        def angles() -> Tensor:
            y, x = (2.0 * (torch.arange(n, device=self._periods.device) + 0.5) / n - 1.0 for n in (rows, columns))
            places = torch.cartesian_prod(y, x)
            return (2.0 * math.pi * places[..., None] / self._periods).flatten(1)

        return self._angles.of(rows, columns, angles)


def rotate(vectors: Tensor, cosines: Tensor, sines: Tensor) -> None:
    """Turn vectors in place.

    Args:
        vectors: (R, h·D), vectors of D channels side by side, of any floating dtype; turned in float32.
        cosines: (R, D/2) float32, of the rows' angles.
        sines: (R, D/2) float32.
    """
    pairs = vectors.unflatten(1, (-1, 2, cosines.shape[1]))
    first, second = pairs.float().unbind(2)
    cosines, sines = cosines[:, None], sines[:, None]
    turned = first * cosines - second * sines
    # In float32, `first` and `second` are views of what is written to.
    pairs[:, :, 1] = second * cosines + first * sines
    pairs[:, :, 0] = turned
