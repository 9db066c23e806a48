"""Where annotated points are looked at: where they lie, or beside it, where what is seen there is not what is meant.

People click on rims. A voxel there may be as dark as what is around, or as bright as the structure, and a cell is wider than a
rim: features, intensity and connectedness at such a point are those of the other side. And people click on what is small: a
nodule's voxel may lie in a block most of which is lung.
"""

from __future__ import annotations

import numpy as np

from .connectedness import SIGMA
from .intensity_blocks import UNITS_PER_WINDOW, UNKNOWN, IntensityBlocks

UNLIKE, ALIKE = 0.5, 0.25
"""Intensities are quite unlike where they are farther apart than the first, and alike within the second, in windows."""
NEXT = np.sqrt(3.0)
"""How far away the blocks are that touch one."""
RIM_CELLS = 1.5
"""A later positive point that is unlike all before it may lie at a rim, if something like one of them is no more than so many
cells away. Chosen, as `UNLIKE`, while looking at one nodule in a lung, and what is done there while looking at three more; see
`Benchmarks/results/candidates.md`, *Positive points at rims* and *Points whose voxel is unlike the block around it*."""
GREY = 1.0
"""Up to so many windows from their middle, intensities are grey: a small nodule is seen together with the lung around it."""
MOSTLY = 0.5
"""Less than this share of what is beside a block is like it, where that is no part by itself."""
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

        What is smaller than a block, or ends in it, is seen in the voxels at a point: where these are grey, and their block is
        dark, a point is looked at at the block beside it that is most like them. A later point only where they are like what
        is looked at before it.

        And people draw a structure's edge where a voxel may be as dark as what is around, as at that of a nodule in a lung; a
        later point there would have all that is around looked for. So where it is quite unlike all before it, and no part of
        the structure by itself, it is looked at at the nearest block that is like one of them; or, in what is darker than a
        grey structure, on the way to them. Where none is near, it lies in another part of the structure.

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
        own, voxels = self._blocks.nearest(positive_ras), self._blocks.units_of_voxels_at(positive_ras)
        blocks = own.copy()
        for point in range(len(own)):
            before = blocks[:point]
            blocks[point] = self._like_its_voxels(own[point], voxels[point], before)
            if point and self._is_at_rim(blocks[point], voxels[point], before):
                blocks[point] = self._beside_rim(blocks[point], before)
        moved = (blocks != own).any(axis=1)
        return np.where(moved[:, None], self._blocks.centres_ras(blocks), positive_ras) if moved.any() else positive_ras

    def _like_its_voxels(self, block: np.ndarray, voxels: float, before: np.ndarray) -> np.ndarray:
        """A point's block (3,), or that beside it which is most like the point's voxels, where these are grey and it is dark.

        `before` are the blocks (N, 3) at which the points before it are looked at.
        """
        own = self._blocks.units_of(block)
        # In a bright block, such as of bone, what is grey is as likely the marrow of the same structure.
        grey_in_dark = UNKNOWN not in (own, voxels) and -own > abs(voxels) + UNLIKE * UNITS_PER_WINDOW
        unlike_before = np.abs(self._blocks.units_of(before) - voxels)
        if not grey_in_dark or (len(before) and unlike_before.min() > ALIKE * UNITS_PER_WINDOW):
            return block
        beside = self._known_within(NEXT, block)
        unlike = np.abs(self._blocks.units_of(beside) - voxels)
        most_alike: np.ndarray = beside[np.lexsort((_distances(beside, block), unlike))[0]]
        return most_alike

    def _is_at_rim(self, block: np.ndarray, voxels: float, before: np.ndarray) -> bool:
        """Whether a later point lies at the structure's rim: it is unlike all before it, and no part of it by itself.

        What is no more alike around it than around those is none; nor is what is darker than they, where they are grey, and
        mostly beside something else.
        """
        own, of_before = float(self._blocks.units_of(block)), self._blocks.units_of(before)
        seen = [own, voxels] if voxels != UNKNOWN and _is_darker(voxels, of_before) else [own]
        unlike = max(np.abs(of_before - units).min() for units in seen)
        if own == UNKNOWN or unlike <= UNLIKE * UNITS_PER_WINDOW:
            return False
        *alike_before, alike = self._share_alike(np.concatenate([before, block[None]]))
        return bool(alike <= max(alike_before) or (alike < MOSTLY and _is_darker(own, of_before)))

    def _beside_rim(self, block: np.ndarray, before: np.ndarray) -> np.ndarray:
        """The block within `RIM_CELLS` of one (3,) that is like one of those before it, (N, 3); itself where there is none.

        Where it is darker than all before it, and these are grey, what is around was clicked, and it is the block on the
        shortest way to them, if need be one of themselves: on the other side there may be something alike that is not meant.
        Else it is the nearest. Of several as near, it is the one that is most like them, in whatever order the volume is
        stored.
        """
        around = self._known_within(RIM_CELLS * self._blocks.per_cell, block)
        unlike = np.abs(self._blocks.units_of(around)[:, None] - self._blocks.units_of(before)).min(axis=1)
        like = unlike <= SIGMA * UNITS_PER_WINDOW
        if not like.any():
            return block
        around, unlike = around[like], unlike[like]
        way = _distances(around, block)
        if _is_darker(float(self._blocks.units_of(block)), self._blocks.units_of(before)):
            way += np.min([_distances(around, each) for each in before], axis=0)
        nearest: np.ndarray = around[np.lexsort((unlike, way))[0]]
        return nearest

    def _share_alike(self, blocks: np.ndarray) -> np.ndarray:
        """The share of what is known beside each of some blocks (N, 3) that is like it, (N,)."""
        shares = []
        for block, own in zip(blocks, self._blocks.units_of(blocks), strict=True):
            units = self._blocks.units_of(self._known_within(NEXT, block))
            shares.append(np.mean(np.abs(units - own) <= ALIKE * UNITS_PER_WINDOW) if own != UNKNOWN else 0.0)
        return np.array(shares)

    def _known_within(self, radius: float, block: np.ndarray) -> np.ndarray:
        """The blocks (N, 3) no farther than so many blocks from one of them, (3,), in which something is finite."""
        around = self._blocks.within(radius, block)
        known: np.ndarray = around[self._blocks.units_of(around) != UNKNOWN]
        return known


def _distances(blocks: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Of blocks (N, 3) from one, (3,), in blocks."""
    distances: np.ndarray = np.sqrt(((blocks - block) ** 2).sum(axis=1))
    return distances


def _is_darker(units: float, structure: np.ndarray) -> bool:
    """Whether an intensity is darker than all of a grey structure's (N,), as lung is.

    Farther below the middle of the window, that is, than they are from it on either side. What is brighter may be a part of
    it, such as the rim of a tumour with contrast medium. Of what is not grey itself, such as a lung, or what PET shows, neither
    says anything.
    """
    least_grey = float(np.abs(structure).max())
    return least_grey <= GREY * UNITS_PER_WINDOW and -units > least_grey
