"""The guided filter in 3D, the alternative to the bilateral solver.

Within a window around each voxel the map is taken to be a linear function of the intensity, a · luma + b, fitted by least
squares with a penalty of ε a². Where the intensity varies by much more than √ε the map follows its edges; where by less, the
map is averaged. All windows that hold a voxel have a say in its a and b. Windows are summed over blocks of voxels, and a and b
are interpolated between blocks (the *fast* guided filter).

References:
    He, Sun, Tang: Guided image filtering. ECCV 2010.
    He, Sun: Fast guided filter. arXiv:1505.00996, 2015.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..core.system.errors import InputError
from . import large_arrays
from .upsampling import Upsampling
from .window_sums import block_sums, window_sums

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

BLOCKS = 5
"""Along each edge of a window. With 3, windows show; more cost more and change little."""


@dataclass(frozen=True)
class GuidedFilterSettings:
    """How far the filter looks, and what it takes for an edge.

    Attributes:
        radius_mm: half of a window's edge, millimetres; rounded so that windows are whole numbers of blocks.
        edge_luma: √ε, the standard deviation of intensity above which it counts as structure, as a fraction of its window.
    """

    radius_mm: float = 6.0
    edge_luma: float = 10.0 / 255.0

    def __post_init__(self) -> None:
        for name in ("radius_mm", "edge_luma"):
            value = getattr(self, name)
            if not value > 0.0 or math.isinf(value):
                raise InputError(f"Guided filter: {name} is {value}; expected a finite number above 0.")


def guided_filter(
    target: Tensor, luma: Tensor, spacing_mm: Sequence[float], settings: GuidedFilterSettings | None = None
) -> Tensor:
    """Filter `target` so that its edges are those of `luma`.

    Args:
        target: (K, J, I); voxels that are not finite are inferred from their neighbours.
        luma: (K, J, I), intensity in units of its window; voxels that are not finite keep the target.
        spacing_mm: along (K, J, I).
        settings: default values where None.

    Returns:
        (K, J, I) float32, within the range of the target.

    Raises:
        InputError: shapes differ, or no voxel of the target is finite.
    """
    import torch

    if target.ndim != 3 or target.shape != luma.shape:
        raise InputError(
            f"Guided filter: target has shape {tuple(target.shape)} and luma {tuple(luma.shape)}; expected the same three axes."
        )
    known_target = target if large_arrays.all_finite(target) else target[torch.isfinite(target)]
    if known_target.numel() == 0:
        raise InputError("Guided filter: no voxel of the map is finite. Compute the map again.")
    settings = settings or GuidedFilterSettings()
    edges = [max(1, round(min(2.0 * settings.radius_mm / BLOCKS / s, n))) for s, n in zip(spacing_mm, luma.shape, strict=True)]
    a, b = _coefficients(_block_moments(target, luma, edges), settings.edge_luma**2)
    # The last blocks may reach beyond the volume.
    padded_shape = [n * edge for n, edge in zip(a.shape, edges, strict=True)]
    a_fine, b_fine = (Upsampling(c, padded_shape) for c in (a, b))
    lowest, highest = large_arrays.extremes(known_target)
    rows, columns = slice(0, luma.shape[1]), luma.shape[2]
    filtered = large_arrays.empty(luma.shape, torch.float32, luma.device)
    # Slice by slice, so that nothing but the result has the volume's size.
    for k, (out, of_luma, of_target) in enumerate(zip(filtered, luma, target, strict=True)):
        a_here, b_here = (fine.read((slice(k, k + 1), rows))[0, :, :columns] for fine in (a_fine, b_fine))
        smooth = (a_here * of_luma + b_here).clamp_(lowest, highest)
        out[...] = smooth if large_arrays.all_finite(of_luma) else torch.where(torch.isfinite(of_luma), smooth, of_target)
    return filtered


def _block_moments(target: Tensor, luma: Tensor, edges: Sequence[int]) -> Tensor:
    """(5, K', J', I'): sums over blocks of 1, luma, target, luma² and luma × target, of voxels where both are finite."""
    import torch

    layers = []
    for k in range(0, len(luma), edges[0]):
        t, g = target[k : k + edges[0]].to(torch.float32), luma[k : k + edges[0]].to(torch.float32)
        finite = torch.isfinite(t) & torch.isfinite(g)
        t, g = torch.where(finite, t, 0.0), torch.where(finite, g, 0.0)
        layers.append(block_sums(torch.stack([finite.to(torch.float32), g, t, g * g, g * t]), edges))
    return torch.cat(layers, dim=1)


def _coefficients(moments: Tensor, epsilon: float) -> tuple[Tensor, Tensor]:
    """The slope a and the offset b of each block: fitted over windows, then averaged over windows. (K', J', I') each."""
    import torch

    count, luma, target, squared, product = window_sums(moments, BLOCKS // 2)
    known = count > 0
    count = count.clamp(min=1.0)
    luma, target = luma / count, target / count
    variance = (squared / count - luma * luma).clamp_(min=0.0)
    a = (product / count - luma * target) / (variance + epsilon)
    b = target - a * luma
    known_coefficients = torch.where(known, torch.stack([torch.ones_like(a), a, b]), 0.0)
    windows, a_sum, b_sum = window_sums(known_coefficients, BLOCKS // 2)
    return a_sum / windows.clamp(min=1.0), b_sum / windows.clamp(min=1.0)
