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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..core.intensity_window import IntensityWindow
from ..core.progress import Between, nothing_between
from .intensity_histograms import BINS, bins_of, density

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
_BINS_SIGMA = 3.0
"""Standard deviation by which histograms are smoothed, in bins."""
_SMALLEST_SHARE = 0.064
"""Of voxels, spread over all bins."""
_UNKNOWN = BINS
"""Bin of voxels that are not finite: of those, the neighbourhood alone decides."""
_VOXELS_AT_ONCE = 2**17
"""So many stay near the processor."""
_VOXELS_HELD = 2**23
"""Steps are made in so many at once, for which ten bytes each are held."""


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

    def in_layers(self, layers: slice) -> Mark:
        """The same in a part of the volume, some layers along K."""
        k, j, i = self.centre
        return replace(self, centre=(k - layers.start, j, i))


def settled(
    mask: np.ndarray,
    intensities: np.ndarray,
    window: IntensityWindow,
    marks: Sequence[Mark] = (),
    between: Between = nothing_between,
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """A mask after `STEPS` steps, some layers after the other, so that little but the mask is held at once.

    Args:
        mask: (K, J, I) bool, with a margin where there is one; beyond its faces it goes on as it is there. The densities inside
            are those of its voxels, outside those of the others. It must stay as it is meanwhile.
        intensities: (K, J, I), any real dtype; a voxel that is not finite goes by its neighbourhood.
        window: in which the structure's edges show.
        marks: places of which it is known whether they are inside.
        between: called between short steps; may raise `Cancelled`.

    Yields:
        Layers along K; the mask there, (layers, J, I) bool; and how much of each voxel's neighbourhood it is, g times `WHOLE`,
        int16 of the same shape.
    """
    import torch

    from .workers import Workers

    before = torch.from_numpy(np.ascontiguousarray(mask)).view(torch.uint8)
    with Workers(torch.device("cpu"), between) as workers:
        bins = _bins(intensities, window, workers)
        least_of_bin = _least_sums(bins, mask, _level(before, workers))
        for layers in _layers(mask.shape, _VOXELS_HELD):
            # A step reaches so far, and so does the sum after the last one: within the layers, nothing is cut off.
            around = _wider(layers, (STEPS + 1) * REACH, len(mask))
            least = np.take(least_of_bin, bins[around])
            _set_marks(least, [mark.in_layers(around) for mark in marks])
            now, sums = _after_steps(before[around], torch.from_numpy(least), workers)
            here = slice(layers.start - around.start, layers.stop - around.start)
            yield layers, now[here].numpy().view(bool), sums[here].numpy()


def _after_steps(now: Tensor, least: Tensor, workers: Workers) -> tuple[Tensor, Tensor]:
    """A mask (K, J, I) uint8 after all steps, and its G * m times `WHOLE`."""
    import torch

    sums = _sums(now, workers)
    for _ in range(STEPS):
        before, now = now, torch.ge(sums, least).view(torch.uint8)
        if torch.equal(before, now):
            break
        sums = _sums(now, workers)
    return now, sums


def _layers(shape: tuple[int, ...], voxels: int) -> list[slice]:
    """All layers along K, about so many voxels at a time, and one layer at least."""
    count = max(voxels // (shape[1] * shape[2]), 1)
    return [slice(start, min(start + count, shape[0])) for start in range(0, shape[0], count)]


def _wider(layers: slice, reach: int, count: int) -> slice:
    """Layers, and as many more on either side as there are, `reach` at most, of `count`."""
    return slice(max(layers.start - reach, 0), min(layers.stop + reach, count))


def _bins(intensities: np.ndarray, window: IntensityWindow, workers: Workers) -> np.ndarray:
    """The bin of each voxel's intensity, (K, J, I) uint8."""
    bins = np.empty(intensities.shape, dtype=np.uint8)
    known = None
    if intensities.dtype in (np.int16, np.uint16, np.int8, np.uint8):
        # Looked up, several times as fast as computed; negative ones count from the table's end, as indices do.
        values = np.arange(2 ** (8 * intensities.dtype.itemsize), dtype=np.int64).astype(intensities.dtype)
        known = _known_bins_of(values, window)

    def look_up(slices: Sequence[int]) -> None:
        for k in slices:
            workers.between()
            bins[k] = _known_bins_of(intensities[k], window) if known is None else known[intensities[k]]

    workers.share_out(range(len(bins)), look_up)
    return bins


def _known_bins_of(intensities: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """The bins of some intensities, uint8 of their shape."""
    bins = bins_of(intensities, window)
    bins[~np.isfinite(intensities)] = _UNKNOWN
    return bins


def _level(mask: Tensor, workers: Workers) -> float:
    """ℓ of a mask (K, J, I) uint8, in (0, ½]."""
    voxels, compact, counts = int(mask.sum()), 0, np.zeros(WHOLE + 1, dtype=np.int64)
    for sums in _sums_in_turn(mask, workers):
        compact += int((sums >= COMPACT * WHOLE).sum())
    if compact >= voxels:
        return 0.5
    for sums in _sums_in_turn(mask, workers):
        counts += np.bincount(sums.numpy().ravel(), minlength=WHOLE + 1)
    keeps_volume = (np.count_nonzero(counts[::-1].cumsum()[::-1] >= voxels) - 1) / WHOLE
    return float(np.interp(max(keeps_volume, 1.0 / WHOLE), [0.0, THIN, COMPACT], [0.0, THIN, 0.5]))


def _sums_in_turn(mask: Tensor, workers: Workers) -> Iterator[Tensor]:
    """G * m of a mask (K, J, I) uint8, times `WHOLE`, of some layers after the other."""
    for layers in _layers(mask.shape, _VOXELS_HELD):
        around = _wider(layers, REACH, len(mask))
        yield _sums(mask[around], workers)[layers.start - around.start : layers.stop - around.start]


def _least_sums(bins: np.ndarray, learned_from: np.ndarray, level: float) -> np.ndarray:
    """The least sum of G's weights on m that a voxel of each bin needs to be inside, (bins,) int16 from 1 to `WHOLE`.

    It is where the odds are even: (G * m)(x) = 1 / (1 + (1 − ℓ) / ℓ · ratio^β).
    """
    # Both histograms by one count: bins of what is inside come after those of the rest.
    counts = np.zeros(2 * (BINS + 1))
    for plane, of_plane in zip(bins, learned_from, strict=True):
        counts += np.bincount((plane + of_plane.view(np.uint8) * np.uint8(BINS + 1)).ravel(), minlength=len(counts))
    outside, inside = counts.reshape(2, -1)
    within, around = (density(of[:BINS], _BINS_SIGMA, _SMALLEST_SHARE) for of in (inside, outside))
    ratio = within / around
    even = WHOLE / (1.0 + (1.0 - level) / level * np.append(ratio**TEMPER, 1.0))
    least: np.ndarray = np.clip(np.ceil(even), 1, WHOLE).astype(np.int16)
    return least


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

    def find(shares: Sequence[slice]) -> None:
        for layers in shares:
            workers.between()
            sums[layers] = _sums_of(mask, layers)

    workers.share_out(_layers(mask.shape, _VOXELS_AT_ONCE), find)
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
