"""Where annotated points are looked at: where they lie, or beside it, where a point shows what is not meant.

People click on rims. A voxel there may be as dark as what is around, or as bright as the structure, and a cell is wider than a
rim: features, intensity and connectedness at such a point are those of the other side.
"""

from __future__ import annotations

import numpy as np

from .connectedness import SIGMA
from .intensity_blocks import UNITS_PER_WINDOW, UNKNOWN, IntensityBlocks

RIM_UNLIKE = 0.5
RIM_CELLS = 1.5
"""A later positive point that is unlike all before it by more than so many windows may lie at a rim, if something like one of
them is no more than so many cells away. Chosen while looking at one nodule in a lung; see `Benchmarks/results/candidates.md`,
*Positive points at rims*."""
SEEN_CLASSES = 256
"""Of so many classes, or states of them, it is kept where their positive points are looked at: each click asks for all again,
and each refinement."""


class PointPlaces:
    """Where the points of classes are best looked at.

    Args:
        blocks: of the volume.
    """

    def __init__(self, blocks: IntensityBlocks) -> None:
        self._blocks = blocks
        # None: where they are.
        self._places_of_key: dict[bytes, np.ndarray | None] = {}

    def of_positives(self, positive_ras: np.ndarray) -> np.ndarray:
        """Where a class's positive points are best looked at: there, or in the structure beside it. Any thread may ask.

        People draw a structure's edge where a voxel may be as dark as what is around, as at that of a nodule in a lung; a later
        point there would have all that is around looked for. So where it is quite unlike all before it, and what is beside it
        no more alike than what is beside these, it is looked at at the nearest block that is like one of them. Where none is
        near, it lies in another part of the structure.

        Args:
            positive_ras: (P, 3) RAS millimetres, in the order placed; outside of the volume, the nearest block counts.

        Returns:
            (P, 3) RAS millimetres; the same array where all points are looked at where they are.
        """
        known, key = self._places_of_key, positive_ras.tobytes()
        if key not in known:
            places = self._within_the_structure(positive_ras)
            if len(known) >= SEEN_CLASSES:
                known = self._places_of_key = {}
            known[key] = None if places is positive_ras else places
        found = known[key]
        return positive_ras if found is None else found

    def of_negatives(self, negative_ras: np.ndarray, positive_ras: np.ndarray) -> np.ndarray:
        """Where a class's negative points are best looked at: there, or at the block that is typical of their cell.

        At a structure's rim a voxel off it may be as bright as the structure; learned as something else, it would take the
        structure away. Where the typical block is less like the positive points than the point's own, by more than σ of
        connectedness, it shows what is meant.

        Args:
            negative_ras: (M, 3) RAS millimetres; outside of the volume, the nearest block counts.
            positive_ras: (P, 3) RAS millimetres, P ≥ 1.

        Returns:
            (M, 3) RAS millimetres, each in the cell of its point.
        """
        if not len(negative_ras):
            return negative_ras
        blocks = self._blocks
        own = blocks.nearest(negative_ras)
        of_cell = blocks.in_cells_of(own)
        units = blocks.units_of(of_cell)
        middle = np.abs(units - np.median(units, axis=1, keepdims=True)).argmin(axis=1)
        points = np.arange(len(own))
        typical, typical_units = of_cell[points, middle], units[points, middle]
        wanted = blocks.units_of(blocks.nearest(positive_ras))
        unlike, own_unlike = (np.abs(of[:, None] - wanted).min(axis=1) for of in (typical_units, blocks.units_of(own)))
        moves = (unlike > own_unlike + SIGMA * UNITS_PER_WINDOW) & (typical_units != UNKNOWN)
        places: np.ndarray = np.where(moves[:, None], blocks.centres_ras(typical), negative_ras)
        return places

    def _within_the_structure(self, positive_ras: np.ndarray) -> np.ndarray:
        """See `of_positives`."""
        blocks = self._blocks.nearest(positive_ras)
        units = self._blocks.units_of(blocks)
        places = positive_ras
        for point in range(1, len(blocks)):
            before = units[:point]
            if units[point] == UNKNOWN or np.abs(before - units[point]).min() <= RIM_UNLIKE * UNITS_PER_WINDOW:
                continue
            *alike_before, alike = self._share_alike(blocks[: point + 1])
            nearest = self._nearest_like(blocks[point], before) if alike <= max(alike_before) else None
            if nearest is not None:
                units[point] = self._blocks.units_of(nearest)
                places = np.concatenate([places[:point], self._blocks.centres_ras(nearest[None]), places[point + 1 :]])
        return places

    def _nearest_like(self, block: np.ndarray, units: np.ndarray) -> np.ndarray | None:
        """The block nearest to one (3,), within `RIM_CELLS`, that has one of some intensities (N,); None where there is none.

        Of several that are as near, it is the one that is most like them, in whatever order the volume is stored.
        """
        around = self._blocks.within(RIM_CELLS * self._blocks.per_cell, block)
        around = around[self._blocks.units_of(around) != UNKNOWN]
        unlike = np.abs(self._blocks.units_of(around)[:, None] - units).min(axis=1)
        like = unlike <= SIGMA * UNITS_PER_WINDOW
        steps = ((around[like] - block) ** 2).sum(axis=1)
        return around[like][np.lexsort((unlike[like], steps))[0]] if like.any() else None

    def _share_alike(self, blocks: np.ndarray) -> np.ndarray:
        """The share of what is known beside each of some blocks (N, 3) that is like it, within half of `RIM_UNLIKE`, (N,)."""
        limit = 0.5 * RIM_UNLIKE * UNITS_PER_WINDOW
        shares = []
        for block, own in zip(blocks, self._blocks.units_of(blocks), strict=True):
            units = self._blocks.units_of(self._blocks.within(np.sqrt(3.0), block))
            shares.append(np.mean(np.abs(units[units != UNKNOWN] - own) <= limit) if own != UNKNOWN else 0.0)
        return np.array(shares)
