"""Threshold dynamics: a surface moves to where it is smooth and the image has an edge.

Diffusing a mask and taking one half of it as its new surface shrinks the surface's area (Merriman, Bence, Osher, 1992); with a
term for what the image says of each voxel, regions of different intensities compete for voxels at the same time (Zhu, Yuille,
1996; Esedoğlu, Tsai, 2006). Here a voxel x is inside if the odds of its neighbourhood and of its own intensity say so:

    m'(x) = [ g / (1 − g) · (1 − ℓ) / ℓ · (p(u_x | inside) / p(u_x | outside))^β ≥ 1 ],    g = (G * m)(x),

with G a Gaussian of one voxel and ℓ = ½. With that alone, what is a few voxels thick vanishes; for it, ℓ is the level of G * m
that keeps the volume (Ruuth, Wetton, 2003). In a noisy scan the two densities overlap, and the neighbourhood decides; where
they are apart, as in the folds of a brain, each voxel does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from ..core.intensity_window import IntensityWindow
from ..core.progress import Between, nothing_between

if TYPE_CHECKING:
    from torch import Tensor

    from .workers import Workers

STEPS = 6
TEMPER = 0.6
"""β: neighbouring voxels are no independent witnesses."""
THIN, COMPACT = 0.4, 0.45
"""Up to which level that keeps the volume ℓ is that level, and from which on it is ½; between them, ℓ is between."""
REACH = 2
"""Voxels to either side that G reaches: 1 4 6 4 1 along each axis."""
WHOLE = 16**3
"""The sum of G's weights, which are whole numbers."""
_BINS = 64
_BINS_SIGMA = 3.0
"""Standard deviation by which histograms are smoothed, in bins."""
_SMALLEST_DENSITY = 1e-3
"""Added to each bin's, so that intensities hardly seen do not decide."""
_UNKNOWN = _BINS
"""Bin of voxels that are not finite: of those, the neighbourhood alone decides."""
_VOXELS_AT_ONCE = 2**17
"""So many stay near the processor."""


@dataclass(frozen=True)
class Mark:
    """What is known of a place: its voxel is inside, or is not, and so is what joins it there.

    Attributes:
        centre: (k, j, i), in voxels.
        radii: how far it is known, along (K, J, I), in voxels.
        inside: what is known.
    """

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]
    inside: bool


def settled(
    mask: np.ndarray,
    intensities: np.ndarray,
    window: IntensityWindow,
    marks: Sequence[Mark] = (),
    between: Between = nothing_between,
) -> tuple[np.ndarray, np.ndarray]:
    """A mask after `STEPS` steps.

    Args:
        mask: (K, J, I) bool, with a margin where there is one; beyond its faces it goes on as it is there. The densities inside
            are those of its voxels, outside those of the others.
        intensities: (K, J, I), any real dtype; a voxel that is not finite goes by its neighbourhood.
        window: in which the structure's edges show.
        marks: places of which it is known whether they are inside.
        between: called between short steps; may raise `Cancelled`.

    Returns:
        The mask, (K, J, I) bool, and how much of each voxel's neighbourhood it is, g times `WHOLE`, (K, J, I) int16.
    """
    import torch

    from .workers import Workers

    with Workers(torch.device("cpu"), between) as workers:
        now = torch.from_numpy(np.ascontiguousarray(mask)).view(torch.uint8)
        sums = _sums(now, workers)
        bins = _bins(intensities, window, workers)
        least = np.take(_least_sums(bins, mask, _level(sums, int(np.count_nonzero(mask)))), bins)
        _set_marks(least, marks)
        for _ in range(STEPS):
            before, now = now, torch.ge(sums, torch.from_numpy(least)).view(torch.uint8)
            if torch.equal(before, now):
                break
            sums = _sums(now, workers)
    return now.numpy().view(bool), sums.numpy()


def _bins(intensities: np.ndarray, window: IntensityWindow, workers: Workers) -> np.ndarray:
    """The bin of each voxel's intensity, (K, J, I) uint8."""
    bins = np.empty(intensities.shape, dtype=np.uint8)
    known = None
    if intensities.dtype in (np.int16, np.uint16, np.int8, np.uint8):
        # Looked up, several times as fast as computed; negative ones count from the table's end, as indices do.
        values = np.arange(2 ** (8 * intensities.dtype.itemsize), dtype=np.int64).astype(intensities.dtype)
        known = _bins_of(values, window)

    def look_up(slices: Sequence[int]) -> None:
        for k in slices:
            workers.between()
            bins[k] = _bins_of(intensities[k], window) if known is None else known[intensities[k]]

    workers.share_out(range(len(bins)), look_up)
    return bins


def _bins_of(intensities: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """The bins of some intensities, uint8 of their shape."""
    bins: np.ndarray = np.minimum(window.apply(intensities) * _BINS, _BINS - 1).astype(np.uint8)
    bins[~np.isfinite(intensities)] = _UNKNOWN
    return bins


def _level(sums: Tensor, voxels: int) -> float:
    """ℓ of a mask of so many voxels from its G * m times `WHOLE`, in (0, ½]."""
    if int((sums >= COMPACT * WHOLE).sum()) >= voxels:
        return 0.5
    reaching = np.bincount(sums.numpy().ravel(), minlength=WHOLE + 1)[::-1].cumsum()[::-1]
    keeps_volume = (np.count_nonzero(reaching >= voxels) - 1) / WHOLE
    return float(np.interp(max(keeps_volume, 1.0 / WHOLE), [0.0, THIN, COMPACT], [0.0, THIN, 0.5]))


def _least_sums(bins: np.ndarray, learned_from: np.ndarray, level: float) -> np.ndarray:
    """The least sum of G's weights on m that a voxel of each bin needs to be inside, (bins,) int16 from 1 to `WHOLE`.

    It is where the odds are even: (G * m)(x) = 1 / (1 + (1 − ℓ) / ℓ · ratio^β).
    """
    # Both histograms by one count: bins of what is inside come after those of the rest.
    counts = np.zeros(2 * (_BINS + 1))
    for plane, of_plane in zip(bins, learned_from, strict=True):
        counts += np.bincount((plane + of_plane.view(np.uint8) * np.uint8(_BINS + 1)).ravel(), minlength=len(counts))
    outside, inside = counts.reshape(2, -1)
    ratio = _density(inside[:_BINS]) / _density(outside[:_BINS])
    even = WHOLE / (1.0 + (1.0 - level) / level * np.append(ratio**TEMPER, 1.0))
    least: np.ndarray = np.clip(np.ceil(even), 1, WHOLE).astype(np.int16)
    return least


def _density(histogram: np.ndarray) -> np.ndarray:
    smooth = ndimage.gaussian_filter1d(histogram, _BINS_SIGMA)
    density: np.ndarray = smooth / max(float(smooth.sum()), 1e-9) + _SMALLEST_DENSITY
    return density


def _set_marks(least: np.ndarray, marks: Sequence[Mark]) -> None:
    """Change the sums (K, J, I) that voxels need as marks say.

    Around a mark, one neighbour on its side is enough, and its own voxel needs none: what is known spreads from there.
    """
    for mark in marks:
        box = tuple(
            slice(max(int(np.ceil(at - radius)), 0), max(int(np.floor(at + radius)) + 1, 0))
            for at, radius in zip(mark.centre, mark.radii, strict=True)
        )
        part = least[box]
        offsets = np.ogrid[tuple(slice(extent.start, extent.start + n) for extent, n in zip(box, part.shape, strict=True))]
        away = sum(((x - at) / radius) ** 2 for x, at, radius in zip(offsets, mark.centre, mark.radii, strict=True))
        part[away <= 1.0] = 1 if mark.inside else WHOLE
    for mark in marks:
        voxel = tuple(round(at) for at in mark.centre)
        if all(0 <= x < n for x, n in zip(voxel, least.shape, strict=True)):
            least[voxel] = 0 if mark.inside else WHOLE + 1


def _sums(mask: Tensor, workers: Workers) -> Tensor:
    """G * m of a mask (K, J, I) uint8, times `WHOLE`, int16; beyond its faces, m goes on as it is there."""
    import torch

    sums = torch.empty(mask.shape, dtype=torch.int16)
    count = max(_VOXELS_AT_ONCE // (mask.shape[1] * mask.shape[2]), 1)

    def find(starts: Sequence[int]) -> None:
        for start in starts:
            workers.between()
            layers = slice(start, min(start + count, len(mask)))
            sums[layers] = _sums_of(mask, layers)

    workers.share_out(range(0, len(mask), count), find)
    return sums


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
    """Sums weighted by 1 4 6 4 1 along an axis, of which those are left that have all five."""
    n = values.shape[axis] - 2 * REACH
    first, second, middle, fourth, last = (values.narrow(axis, start, n) for start in range(2 * REACH + 1))
    return (first + last).add_(second + fourth, alpha=4).add_(middle, alpha=6)
