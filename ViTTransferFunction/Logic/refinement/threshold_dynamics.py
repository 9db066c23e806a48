"""Threshold dynamics: moves a surface to where it is smooth and the image has an edge.

Diffusing a mask and thresholding it at ½ reduces the area of its surface (Merriman, Bence, Osher, 1992). With an additional
image term for each voxel, regions of different intensities compete for voxels at the same time (Zhu, Yuille, 1996; Esedoğlu,
Tsai, 2006). Here a voxel x is inside if the product of the odds by its neighbourhood and by its own intensity is at least 1:

    m'(x) = [ g / (1 − g) · (1 − ℓ) / ℓ · (p(u_x | inside) / p(u_x | outside))^β ≥ 1 ],    g = (G * m)(x),

where G is a Gaussian with a standard deviation of one voxel, and ℓ = ½. This alone would make structures vanish that are only a
few voxels thick. For these, ℓ is the level of G * m that preserves the volume (Ruuth, Wetton, 2003). In a noisy scan the two
densities overlap, and the neighbourhood decides; if they are well separated, as in the folds of a brain, each voxel's own
intensity does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..core.system.progress import Between, nothing_between
from ..core.volumes.geometry import Box
from ..core.volumes.intensity_window import IntensityWindow
from ..core.volumes.torch_arrays import array_of, tensor_of
from .intensity_histograms import BINS, bins_of, density
from .neighbourhood_sums import REACH, WHOLE, neighbourhood_sums, updated_sums
from .parts import parts

if TYPE_CHECKING:
    from torch import Tensor

    from .workers import Workers

STEPS = 6
TEMPER = 0.6
"""β: below 1, because the intensities of neighbouring voxels are not independent evidence."""
THIN, COMPACT = 0.4, 0.45
"""ℓ is the level that preserves the volume if that is at most `THIN`, and ½ from `COMPACT` on; in between, it is
interpolated."""
_BINS_SIGMA = 3.0
"""Standard deviation of the smoothing of histograms, in bins."""
_SMALLEST_SHARE = 0.064
"""Share of voxels that is distributed evenly over all bins, so that no density is 0."""
_UNKNOWN = BINS
"""Bin of voxels that are not finite; for these, the neighbourhood alone decides."""
_VOXELS_HELD = 2**23
"""Number of voxels that are processed at once, at nine bytes each."""


@dataclass(frozen=True)
class Mark:
    """A place of which it is known whether it is inside: its voxel, and what is connected to it nearby.

    Attributes:
        centre: (k, j, i), in voxels.
        radii: semi-axes of the ellipsoid in which it applies, along (K, J, I), in voxels.
        inside: whether the place is inside.
    """

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]
    inside: bool

    def in_layers(self, layers: slice) -> Mark:
        """The same mark in the coordinates of a part of the volume, some layers along K."""
        k, j, i = self.centre
        return replace(self, centre=(k - layers.start, j, i))

    def voxel_of(self, shape: tuple[int, ...]) -> Box:
        """The box of the one voxel that contains the centre, in a volume of `shape` (K, J, I); empty if it lies outside."""
        k, j, i = (
            slice(min(max(at, 0), n), min(max(at + 1, 0), n))
            for at, n in zip((math.floor(x + 0.5) for x in self.centre), shape, strict=True)
        )
        return k, j, i

    def known_of(self, shape: tuple[int, ...]) -> tuple[Box, np.ndarray]:
        """The ellipsoid in a volume of `shape` (K, J, I): its bounding box, and whether each voxel of it is inside, bool."""
        k, j, i = (
            slice(*(min(max(end, 0), n) for end in (math.ceil(at - radius), math.floor(at + radius) + 1)))
            for at, radius, n in zip(self.centre, self.radii, shape, strict=True)
        )
        offsets = np.ogrid[k, j, i]
        away = sum(((x - at) / radius) ** 2 for x, at, radius in zip(offsets, self.centre, self.radii, strict=True))
        return (k, j, i), np.asarray(away <= 1.0)


def settled(
    mask: np.ndarray,
    intensities: np.ndarray,
    window: IntensityWindow,
    marks: Sequence[Mark] = (),
    between: Between = nothing_between,
) -> Iterator[np.ndarray]:
    """The mask after `STEPS` steps, computed and yielded in stacks of layers to save memory.

    Args:
        mask: (K, J, I) bool, with a margin if the volume has one; beyond the faces, the outermost voxels are repeated. Its
            voxels define the density inside, all others the density outside. It must not change meanwhile.
        intensities: (K, J, I), any real dtype; for voxels that are not finite, the neighbourhood alone decides.
        window: intensity window in which the edges of the structure are visible.
        marks: places that are known to be inside or outside.
        between: called between short steps; may raise `Cancelled`.

    Yields:
        Consecutive stacks of layers of the mask along K, (layers, J, I) bool.
    """
    import torch

    from .workers import Workers

    before = tensor_of(np.ascontiguousarray(mask)).view(torch.uint8)
    in_turn = parts(mask.shape, _VOXELS_HELD, STEPS * REACH)
    with Workers(torch.device("cpu"), mask.size, between) as workers:
        # Most masks have one part, whose sums are needed twice: for the level, and for the steps.
        sums_of = lru_cache(maxsize=1)(lambda n: neighbourhood_sums(before[in_turn[n].around], workers))
        level = _level(int(mask.sum()), lambda: (sums_of(n)[part.within] for n, part in enumerate(in_turn)))
        bins = _bins(intensities, window, workers)
        least_of_bin = _least_sums(bins, mask, level)
        for n, part in enumerate(in_turn):
            least = np.take(least_of_bin, bins[part.around])
            _set_marks(least, [mark.in_layers(part.around) for mark in marks])
            now = _after_steps(before[part.around], sums_of(n), least, workers)
            yield array_of(now[part.within]).view(bool)


def _after_steps(mask: Tensor, sums: Tensor, least: np.ndarray, workers: Workers) -> Tensor:
    """The mask after all steps, or once it does not change any more.

    Args:
        mask: (K, J, I) uint8.
        sums: its G * m times `WHOLE`; may be changed in place.
        least: the sum that each voxel needs to be inside, (K, J, I).
        workers: share the work.

    Returns:
        (K, J, I) uint8.
    """
    import torch

    changed = np.empty(0, dtype=np.int64)
    for _ in range(STEPS):
        workers.between()
        if len(changed):
            sums = updated_sums(sums, mask, changed, workers)
        now = array_of(sums) >= least
        changed = np.flatnonzero(now != array_of(mask).view(bool))
        if not len(changed):
            break
        mask = tensor_of(now).view(torch.uint8)
    return mask


def _bins(intensities: np.ndarray, window: IntensityWindow, workers: Workers) -> np.ndarray:
    """The bin of each voxel's intensity, (K, J, I) uint8."""
    bins = np.empty(intensities.shape, dtype=np.uint8)
    known = None
    if intensities.dtype in (np.int16, np.uint16, np.int8, np.uint8):
        # A lookup table is several times as fast. Negative intensities index it from its end.
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


def _level(voxels: int, sums_in_turn: Callable[[], Iterable[Tensor]]) -> float:
    """ℓ of a mask with this number of voxels, in (0, ½], from its G * m times `WHOLE` in stacks of layers."""
    least = math.ceil(COMPACT * WHOLE)
    compact = sum(int(np.count_nonzero(array_of(sums) >= least)) for sums in sums_in_turn())
    if compact >= voxels:
        return 0.5
    counts = np.zeros(WHOLE + 1, dtype=np.int64)
    for sums in sums_in_turn():
        counts += np.bincount(array_of(sums[sums > 0]), minlength=WHOLE + 1)
    # Above 0, since each voxel of the mask contributes to its own sum.
    keeps_volume = (np.count_nonzero(counts[::-1].cumsum()[::-1] >= voxels) - 1) / WHOLE
    return float(np.interp(keeps_volume, [0.0, THIN, COMPACT], [0.0, THIN, 0.5]))


def _least_sums(bins: np.ndarray, learned_from: np.ndarray, level: float) -> np.ndarray:
    """The sum G * m times `WHOLE` that a voxel of each bin needs to be inside, (bins,) int16 from 1 to `WHOLE`.

    At this sum the odds are even: (G * m)(x) = 1 / (1 + (1 − ℓ) / ℓ · ratio^β).
    """
    # One count for both histograms: the bins of voxels inside follow those of voxels outside.
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
    """Set the sums (K, J, I) that voxels need at marks.

    Within a mark, one neighbour on its side is enough, and the voxel at its centre needs none, so that it spreads from there.
    """
    for mark in marks:
        box, known = mark.known_of(least.shape)
        least[box][known] = 1 if mark.inside else WHOLE
    for mark in marks:
        least[mark.voxel_of(least.shape)] = 0 if mark.inside else WHOLE + 1
