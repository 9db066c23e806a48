"""The places at which annotated points are looked at: their own, or one nearby that shows better what the user means.

People click on rims. A voxel at the rim may be as dark as the surroundings or as bright as the structure, and a cell is wider
than a rim, so that features, intensity and connectedness at such a point are those of the other side. People also click on
small structures: a nodule's voxel may lie in a block that is mostly lung.
"""

from __future__ import annotations

import numpy as np

from .connectedness import SIGMA
from .intensity_blocks import UNITS_PER_WINDOW, UNKNOWN, IntensityBlocks

UNLIKE, ALIKE = 0.5, 0.25
"""Intensities are unlike if they differ by more than the first, and alike up to the second, in widths of the window."""
NEXT = np.sqrt(3.0)
"""Distance within which blocks touch a block, in blocks."""
RIM_CELLS = 1.5
"""A later positive point that is unlike all before it may lie at a rim if there is something like one of them within this
distance, in cells. Chosen, like `UNLIKE`, while looking at one nodule in a lung, and the procedure while looking at three more;
see `Benchmarks/results/candidates.md`, *Positive points at rims* and *Points whose voxel is unlike the block around it*."""
GREY = 1.0
"""Intensities up to this many widths from the window's middle are grey, since small nodules are averaged with lung."""
MOSTLY = 0.5
"""A block is no part of its own if less than this share of the blocks beside it is like it."""
SEEN_CLASSES = 256
"""Number of classes, or states of them, for which places are kept, because each click and each refinement needs those of all
classes again."""


class PointPlaces:
    """Finds the places at which the points of classes are looked at.

    Args:
        blocks: the volume's intensities in blocks.
    """

    def __init__(self, blocks: IntensityBlocks) -> None:
        self._blocks = blocks
        # None: the points' own places.
        self._places_of_key: dict[bytes, np.ndarray | None] = {}

    def of_positives(self, positive_ras: np.ndarray) -> np.ndarray:
        """The places for a class's positive points: their own, or one in the structure nearby. Any thread may call this.

        Structures that are smaller than a block, or end in it, show in the voxels at a point. If these are grey and their block
        is dark, the point moves to the block beside it that is most like these voxels. A later point does so only if its voxels
        are like the place of an earlier point.

        A point at a structure's edge, such as that of a nodule in a lung, may lie on a voxel as dark as the surroundings; as a
        later point, it would make the map include all of these. Therefore a later point that is unlike all before it, and no
        part of the structure by itself, moves to the nearest block that is like one of them; if it is darker than a grey
        structure, to the one on the shortest way to them. If there is no such block nearby, the point lies in another part of
        the structure, and stays.

        Args:
            positive_ras: (P, 3) RAS millimetres, in the order placed; outside the volume, the nearest block counts.

        Returns:
            (P, 3) RAS millimetres; the same array if no point moves.
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
        """The places for a class's negative points: their own, or the block with the median intensity of their cell.

        At a structure's rim, a voxel outside may be as bright as the structure; a negative point there would remove the
        structure. Therefore the point moves to the typical block if that is less like the positive points than its own block
        is, by more than σ of connectedness.

        Args:
            negative_ras: (M, 3) RAS millimetres; outside the volume, the nearest block counts.
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
        """A point's block (3,) or, if it is dark and the point's voxels are grey, the block beside it most like these voxels.

        `before` are the blocks (N, 3) of the earlier points' places.
        """
        own = self._blocks.units_of(block)
        # Not in bright blocks, such as bone: grey voxels there are as likely the marrow of the same structure.
        grey_in_dark = UNKNOWN not in (own, voxels) and -own > abs(voxels) + UNLIKE * UNITS_PER_WINDOW
        unlike_before = np.abs(self._blocks.units_of(before) - voxels)
        if not grey_in_dark or (len(before) and unlike_before.min() > ALIKE * UNITS_PER_WINDOW):
            return block
        beside = self._known_within(NEXT, block)
        unlike = np.abs(self._blocks.units_of(beside) - voxels)
        most_alike: np.ndarray = beside[np.lexsort((_distances(beside, block), unlike))[0]]
        return most_alike

    def _is_at_rim(self, block: np.ndarray, voxels: float, before: np.ndarray) -> bool:
        """Whether a later point lies at the structure's rim: it is unlike all before it, and no part of its own.

        It is no part of its own if the share of similar blocks around it is not larger than around the earlier points; or if
        the earlier ones are grey, it is darker than they are, and most blocks beside it are unlike it.
        """
        own, of_before = float(self._blocks.units_of(block)), self._blocks.units_of(before)
        seen = [own, voxels] if voxels != UNKNOWN and _is_darker(voxels, of_before) else [own]
        unlike = max(np.abs(of_before - units).min() for units in seen)
        if own == UNKNOWN or unlike <= UNLIKE * UNITS_PER_WINDOW:
            return False
        *alike_before, alike = self._share_alike(np.concatenate([before, block[None]]))
        return bool(alike <= max(alike_before) or (alike < MOSTLY and _is_darker(own, of_before)))

    def _beside_rim(self, block: np.ndarray, before: np.ndarray) -> np.ndarray:
        """The nearest block within `RIM_CELLS` of one (3,) that is like one of those before it (N, 3); itself if there is none.

        If it is darker than all before it and these are grey, the surroundings were clicked. Then it is the block on the
        shortest way to the earlier ones, perhaps one of these, since similar blocks on its other side may be another structure.
        Among equally near blocks, the most similar one is taken, independent of the order in which the volume is stored.
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
        """For each of some blocks (N, 3), the share of known blocks beside it that are like it, (N,)."""
        shares = []
        for block, own in zip(blocks, self._blocks.units_of(blocks), strict=True):
            units = self._blocks.units_of(self._known_within(NEXT, block))
            shares.append(np.mean(np.abs(units - own) <= ALIKE * UNITS_PER_WINDOW) if own != UNKNOWN else 0.0)
        return np.array(shares)

    def _known_within(self, radius: float, block: np.ndarray) -> np.ndarray:
        """The blocks (N, 3) within a radius, in blocks, of one (3,) that contain finite intensities."""
        around = self._blocks.within(radius, block)
        known: np.ndarray = around[self._blocks.units_of(around) != UNKNOWN]
        return known


def _distances(blocks: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Distances of blocks (N, 3) from one (3,), in blocks."""
    distances: np.ndarray = np.sqrt(((blocks - block) ** 2).sum(axis=1))
    return distances


def _is_darker(units: float, structure: np.ndarray) -> bool:
    """Whether an intensity is darker than all of a grey structure's (N,), as lung is.

    That is, it lies further below the window's middle than any of them is from the middle, above or below. Brighter intensities
    may be a part of the structure, such as the rim of a tumour with contrast medium. If the structure itself is not grey, as a
    lung or in PET, the answer is False.
    """
    least_grey = float(np.abs(structure).max())
    return least_grey <= GREY * UNITS_PER_WINDOW and -units > least_grey
