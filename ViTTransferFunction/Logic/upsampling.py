"""Trilinear interpolation of a coarse map to a volume's resolution."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import large_arrays

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor


def upsampled(coarse: Tensor, shape: Sequence[int]) -> Tensor:
    """Interpolate a map (K', J', I') trilinearly to `shape` (K, J, I), both filling the same box; float32.

    As `torch.nn.functional.interpolate` does without aligned corners, several times faster.
    """
    import torch
    from torch.nn.functional import interpolate

    planes = coarse.to(torch.float32)[:, None]
    planes = interpolate(planes, size=tuple(shape[1:]), mode="bilinear", align_corners=False)[:, 0]
    fine = large_arrays.empty(shape, torch.float32, planes.device)
    last = len(planes) - 1
    for k, fine_plane in enumerate(fine):
        position = min(max((k + 0.5) * len(planes) / len(fine) - 0.5, 0.0), float(last))
        lower = int(position)
        torch.lerp(planes[lower], planes[min(lower + 1, last)], position - lower, out=fine_plane)
    return fine
