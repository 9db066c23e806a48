"""How frequent intensities are within a structure and around it: what its intensity window is chosen by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.volumes.bounding_box import bounding_box, grown, whole_box
from ..core.volumes.geometry import Box
from ..core.volumes.intensity_window import telling_decimals
from .composition import DEPTH, INTENSITY, NUMBER, SURFACE
from .structure_volume import StructureVolume

BINS = 64

NEIGHBOURHOOD_MM = 10.0
"""What is no further from a structure of a body, along each axis of the volume, is what it is to be told from."""

SAMPLED_VOXELS = 200_000
"""As many voxels give the same picture as all of them, in some milliseconds."""

RARE = 0.01
"""Share of voxels at either end of the intensities that the histogram need not show."""

ROOM = 1.5
"""How far the histogram reaches beyond a structure's own intensities to either side, of their span: if it showed all of the air
and bone around an organ, there would be no room for its window."""

NARROWEST = 0.05
"""Span of a structure's intensities, of all that there are, which is enough to be seen."""

HANDLE_STEPS = 1000
"""From one end of a histogram to the other, of what ends of a window are moved by."""


@dataclass(frozen=True, eq=False)
class IntensityHistogram:
    """Shares of voxels by intensity.

    Attributes:
        edges: (BINS + 1,) intensities, evenly increasing.
        inside: (BINS,), of the structure's voxels those between an edge and the next. Others lie beyond.
        outside: (BINS,), of the voxels around it.
    """

    edges: np.ndarray
    inside: np.ndarray
    outside: np.ndarray

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest intensity that it shows."""
        return float(self.edges[0]), float(self.edges[-1])

    @property
    def step(self) -> float:
        """How far a step takes the end of a window."""
        first, last = self.ends
        return max((last - first) / HANDLE_STEPS, 1e-9)

    @property
    def decimals(self) -> int:
        """Digits after the point that tell intensities apart which are a step apart."""
        first, last = self.ends
        return telling_decimals(last - first)


def intensity_histogram(structures: StructureVolume, index: int) -> IntensityHistogram:
    """The histogram of the structure of an index, from 0, and of what lies around it."""
    levels = structures.levels
    inside, outside = (counts / max(counts.sum(), 1) for counts in _level_counts(structures, index + 1))
    edges = _edges(inside, outside, levels)
    return IntensityHistogram(edges, _in_bins(inside, levels, edges), _in_bins(outside, levels, edges))


def _level_counts(structures: StructureVolume, number: int) -> tuple[np.ndarray, np.ndarray]:
    """How many of a sample of voxels within and around a structure have each grey level, (256,) both."""
    voxels = structures.voxels
    box = _box_of(voxels, number)
    if box is None:
        return np.zeros(256), np.zeros(256)
    reach = np.ceil(structures.body_scale * NEIGHBOURHOOD_MM / np.array(structures.geometry.spacing_mm)[::-1]).astype(int)
    around = grown(box, reach.tolist(), whole_box(voxels.shape[:3]))
    step = _step(voxels[around])
    sample = voxels[around][::step, ::step, ::step]
    inside = _belongs(sample, number)
    near = _grown(inside, np.maximum(reach // step, 1).tolist())
    levels = sample[..., INTENSITY]
    return np.bincount(levels[inside], minlength=256), np.bincount(levels[near & ~inside], minlength=256)


def _box_of(voxels: np.ndarray, number: int) -> Box | None:
    """A box that holds all of a structure's voxels, or nearly; None: it has none."""
    for coarse in (_step(voxels), 1):  # What is too fine for the sample is looked for voxel by voxel.
        box = bounding_box(_belongs(voxels[::coarse, ::coarse, ::coarse], number))
        if box is not None:
            k, j, i = (slice(coarse * extent.start, coarse * extent.stop) for extent in box)
            return k, j, i
    return None


def _step(voxels: np.ndarray) -> int:
    """Each how many-th voxel of each axis is looked at."""
    return max(1, int(np.ceil(np.cbrt(voxels[..., 0].size / SAMPLED_VOXELS))))


def _belongs(voxels: np.ndarray, number: int) -> np.ndarray:
    belongs: np.ndarray = (voxels[..., NUMBER] == number) & (voxels[..., DEPTH] > SURFACE)
    return belongs


def _grown(mask: np.ndarray, reach: list[int]) -> np.ndarray:
    """A mask with all voxels that are no further from it than `reach` along the axes K, J and I."""
    grown: np.ndarray = mask.copy()
    for axis, steps in enumerate(reach):
        along = np.moveaxis(grown, axis, 0)
        done = 0
        while done < steps:
            # What has grown by some voxels grows by as many more at once.
            more = min(max(done, 1), steps - done, len(along) - 1)
            if more < 1:
                break
            before = along.copy()
            along[more:] |= before[:-more]
            along[:-more] |= before[more:]
            done += more
    return grown


def _edges(inside: np.ndarray, outside: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Between which intensities the histogram is drawn, in even parts."""
    if not inside.sum():
        return _even(levels[0], levels[-1])
    own, all_of_them = _common(inside, levels), _common(inside + outside, levels)
    span = max(own[1] - own[0], NARROWEST * (levels[-1] - levels[0]))
    low, high = max(own[0] - ROOM * span, all_of_them[0]), min(own[1] + ROOM * span, all_of_them[1])
    margin = 0.05 * max(high - low, span)
    return _even(low - margin, high + margin)


def _common(shares: np.ndarray, levels: np.ndarray) -> tuple[float, float]:
    """Between which intensities all but the rare voxels lie."""
    cumulative = np.cumsum(shares) / shares.sum()
    first, last = np.searchsorted(cumulative, [RARE, 1.0 - RARE])
    return float(levels[max(first - 1, 0)]), float(levels[min(last + 1, 255)])


def _even(first: float, last: float) -> np.ndarray:
    edges: np.ndarray = np.linspace(first, last, BINS + 1)
    return edges


def _in_bins(shares: np.ndarray, levels: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Shares by grey level as shares by bin; a level stands for the intensities that are nearer to its own than to others'."""
    bounds = np.concatenate([levels[:1], 0.5 * (levels[1:] + levels[:-1]), levels[-1:]])
    binned: np.ndarray = np.diff(np.interp(edges, bounds, np.concatenate([[0.0], np.cumsum(shares)])))
    return binned
