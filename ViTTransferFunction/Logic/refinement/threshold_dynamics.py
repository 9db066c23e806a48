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
"""β: neighbouring voxels are no independent witnesses."""
THIN, COMPACT = 0.4, 0.45
"""Up to which level that keeps the volume ℓ is that level, and from which on it is ½; between them, ℓ is between."""
_BINS_SIGMA = 3.0
"""Standard deviation by which histograms are smoothed, in bins."""
_SMALLEST_SHARE = 0.064
"""Of voxels, spread over all bins."""
_UNKNOWN = BINS
"""Bin of voxels that are not finite: of those, the neighbourhood alone decides."""
_VOXELS_HELD = 2**23
"""Steps are made in so many at once, for which nine bytes each are held."""


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

    def voxel_of(self, shape: tuple[int, ...]) -> Box:
        """The box of a volume of `shape` (K, J, I) that is the voxel with the centre in it; empty where there is none."""
        k, j, i = (
            slice(min(max(at, 0), n), min(max(at + 1, 0), n))
            for at, n in zip((math.floor(x + 0.5) for x in self.centre), shape, strict=True)
        )
        return k, j, i

    def known_of(self, shape: tuple[int, ...]) -> tuple[Box, np.ndarray]:
        """A box of a volume of `shape` (K, J, I), and which of its voxels are known, bool of the box's shape."""
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
    """A mask after `STEPS` steps, some layers after the other, so that little but the mask is held at once.

    Args:
        mask: (K, J, I) bool, with a margin where there is one; beyond its faces it goes on as it is there. The densities inside
            are those of its voxels, outside those of the others. It must stay as it is meanwhile.
        intensities: (K, J, I), any real dtype; a voxel that is not finite goes by its neighbourhood.
        window: in which the structure's edges show.
        marks: places of which it is known whether they are inside.
        between: called between short steps; may raise `Cancelled`.

    Yields:
        The mask in some layers after the other along K, (layers, J, I) bool.
    """
    import torch

    from .workers import Workers

    before = tensor_of(np.ascontiguousarray(mask)).view(torch.uint8)
    in_turn = parts(mask.shape, _VOXELS_HELD, STEPS * REACH)
    with Workers(torch.device("cpu"), mask.size, between) as workers:
        # Most masks are one part, whose sums are found once for the level and the steps.
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
    """A mask (K, J, I) uint8 after all steps. Its G * m times `WHOLE` before them, `sums`, are changed."""
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


def _level(voxels: int, sums_in_turn: Callable[[], Iterable[Tensor]]) -> float:
    """ℓ of a mask of so many voxels, in (0, ½], from its G * m times `WHOLE`, of some layers after the other."""
    least = math.ceil(COMPACT * WHOLE)
    compact = sum(int(np.count_nonzero(array_of(sums) >= least)) for sums in sums_in_turn())
    if compact >= voxels:
        return 0.5
    counts = np.zeros(WHOLE + 1, dtype=np.int64)
    for sums in sums_in_turn():
        counts += np.bincount(array_of(sums[sums > 0]), minlength=WHOLE + 1)
    # Above 0, since each of the mask's voxels has a weight in its own sum.
    keeps_volume = (np.count_nonzero(counts[::-1].cumsum()[::-1] >= voxels) - 1) / WHOLE
    return float(np.interp(keeps_volume, [0.0, THIN, COMPACT], [0.0, THIN, 0.5]))


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
        box, known = mark.known_of(least.shape)
        least[box][known] = 1 if mark.inside else WHOLE
    for mark in marks:
        least[mark.voxel_of(least.shape)] = 0 if mark.inside else WHOLE + 1
