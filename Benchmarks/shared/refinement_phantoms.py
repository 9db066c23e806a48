"""Volumes of any size whose structure is known, with the coarse similarity map that would be refined."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

VOXELS_PER_FEATURE = 4
"""Along each axis: how much coarser the similarity map is than the volume."""


class Phantom(NamedTuple):
    """What a refinement is given, and what it should find.

    Attributes:
        coarse_map: (K', J', I'), the structure averaged, blurred and noisy, as a similarity map is.
        luma: (K, J, I) in [0, 1].
        structure: (K, J, I) bool.
    """

    coarse_map: Tensor
    luma: Tensor
    structure: Tensor


def body_phantom(size: int, noise: float = 0.03) -> Phantom:
    """A sphere and a thin torus (the structure) in an ellipsoid of varying brightness, beside another organ."""
    z, y, x = _axes(size)
    sphere = (x - 0.3) ** 2 + (y + 0.1) ** 2 + (z - 0.1) ** 2 < 0.3**2
    torus = (((x + 0.35) ** 2 + y**2).sqrt() - 0.3) ** 2 + z**2 < 0.1**2
    body = x**2 / 0.8 + y**2 / 0.6 + z**2 / 1.2 < 1.0
    organ = (x - 0.3) ** 2 / 0.02 + (y - 0.4) ** 2 / 0.05 + (z + 0.3) ** 2 / 0.1 < 1.0
    luma = torch.where(body, 0.35, 0.05) + 0.04 * torch.sin(4.0 * x) * torch.cos(3.0 * y)
    for inside, level in ((organ, 0.5), (sphere, 0.6), (torus, 0.75)):
        luma[inside] = level
    return _phantom(luma, sphere | torus, noise)


def sphere_phantom(size: int, radius: float) -> Phantom:
    """One sphere, of a radius in units of the volume's edge."""
    z, y, x = _axes(size)
    sphere = x**2 + y**2 + z**2 < (2.0 * radius) ** 2
    return _phantom(torch.where(sphere, 0.6, 0.35), sphere, 0.03)


def coarse_map_of(structure: Tensor) -> Tensor:
    """(K', J', I'): a structure as a similarity map would show it."""
    from torch.nn.functional import avg_pool3d

    generator = torch.Generator().manual_seed(1)
    share = avg_pool3d(structure[None, None].to(torch.float32), VOXELS_PER_FEATURE, ceil_mode=True, count_include_pad=False)
    blurred = avg_pool3d(share, 3, stride=1, padding=1, count_include_pad=False)[0, 0]
    return (blurred + 0.05 * torch.randn(blurred.shape, generator=generator)).clamp_(0.0, 1.0)


def best_dice(refined: Tensor, structure: Tensor) -> float:
    """Dice at the threshold that suits the map best: refinement changes its range."""
    size = int(structure.sum())
    overlaps = []
    for threshold in np.linspace(0.2, 0.8, 13):
        inside = refined > threshold
        overlaps.append(2.0 * int((inside & structure).sum()) / (int(inside.sum()) + size))
    return max(overlaps)


def _axes(size: int) -> tuple[Tensor, Tensor, Tensor]:
    along = torch.linspace(-1.0, 1.0, size)
    return along[:, None, None], along[:, None], along


def _phantom(luma: Tensor, structure: Tensor, noise: float) -> Phantom:
    generator = torch.Generator().manual_seed(0)
    for plane in luma:
        plane.add_(torch.randn(plane.shape, generator=generator), alpha=noise).clamp_(0.0, 1.0)
    return Phantom(coarse_map_of(structure), luma, structure)
