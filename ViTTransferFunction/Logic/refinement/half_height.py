"""Moves surfaces to half the height of strong edges, where a voxel contains equal parts of both sides.

Where tissue ends at lung, gas or air, voxels at the border contain some of both. They resemble neither side, so that densities
learned from the two sides say little about them, and small structures lose them. A voxel is half inside if its intensity is
halfway between those of both sides, which are measured in its neighbourhood (Lankton, Tannenbaum, 2008):

    m'(x) = [ (u_x − (c₁ + c₂) / 2) (c₁ − c₂) > 0 ],    c₁ = G * (u m) / G * m,    c₂ = G * (u (1 − m)) / G * (1 − m)

An edge is strong if a person sees it as grey next to black or white: c₁ and c₂ differ by more than the whole display window.
Grey voxels, whose intensities lie in that window, are as often another tissue as a mixture: fat and diaphragm between spleen
and lung, or muscle between bone and lung. They change sides only if one side is almost all grey and the other has hardly any
grey, as with a nodule and the lung around it.

G is a box of some millimetres, made of blocks of voxels, and all sums are whole numbers, so that the result depends neither on
the order in memory nor on the parts in which it is computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.system.progress import Between, nothing_between
from ..core.volumes.geometry import Box, Geometry
from ..core.volumes.intensity_window import IntensityWindow
from ..core.volumes.orientation import canonical_orientation, voxels_before
from ..core.volumes.torch_arrays import array_of, tensor_of
from .neighbourhood_sums import REACH, neighbourhood_sums
from .parts import parts
from .threshold_dynamics import Mark
from .window_sums import block_sums, window_sums

STEPS = 3
STRONG = 1.0
"""Least difference of the two sides at a strong edge, in widths of the display window."""
SMALLEST_SHARE = 0.2
"""Least share of a neighbourhood that each side must have, unless the surface divides the block in the middle."""
HARDLY_GREY = 0.25
"""A side with at most this share of grey voxels has hardly any grey; with all but this share, it is almost all grey."""
BLOCK_MM = 2.5
"""Edge of the blocks; a neighbourhood is three blocks wide."""
_LARGEST_BLOCK = 4
"""Largest edge of a block, in voxels: even where these are very small, edges are only a few voxels wide."""
_LEVELS_PER_WIDTH = 600
_WIDTHS_AROUND = 2.5
"""How far beyond the display window intensities are distinguished, in widths of it; metal counts as white as bone."""
_VOXELS_HELD = 2**24
"""Voxels that are processed at once; each takes half a dozen bytes meanwhile, and dozens near the surface."""


@dataclass(frozen=True)
class BlockGrid:
    """Blocks of voxels in a box of a volume.

    Attributes:
        edges: edges of a block along (K, J, I), in voxels.
        before: by how many voxels the first blocks begin before the box, along (K, J, I).
    """

    edges: tuple[int, int, int]
    before: tuple[int, int, int]

    @classmethod
    def of(cls, geometry: Geometry, box: Box) -> BlockGrid:
        """The blocks of a volume's box; they begin at the same end of the patient, however the volume is stored."""
        k, j, i = np.clip(np.rint(BLOCK_MM / geometry.spacing_mm[::-1]), 1, _LARGEST_BLOCK).astype(int).tolist()
        from_end = canonical_orientation(geometry).runs_along
        first = box[0].start, box[1].start, box[2].start
        return cls((k, j, i), voxels_before(geometry.shape, (k, j, i), from_end, first))

    def in_layers(self, layers: slice) -> BlockGrid:
        """The same blocks in a range of the box's layers along K."""
        k, j, i = self.before
        return BlockGrid(self.edges, ((k + layers.start) % self.edges[0], j, i))


def at_half_height(
    mask: np.ndarray,
    intensities: np.ndarray,
    grid: BlockGrid,
    display: IntensityWindow,
    marks: Sequence[Mark] = (),
    between: Between = nothing_between,
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Move a mask's surface to half the height of strong edges; yields some layers after the other.

    Args:
        mask: (K, J, I) bool. It must not be changed meanwhile.
        intensities: (K, J, I), any real dtype; voxels that are not finite stay on their side.
        grid: the blocks that neighbourhoods are made of.
        display: the window in which a person would look at the intensities.
        marks: places that stay on their side.
        between: called between short steps; may raise `Cancelled`.

    Yields:
        A range of layers along K; the new mask there, (layers, J, I) bool; and the share of each voxel's neighbourhood that it
        fills, g of `threshold_dynamics` times `WHOLE`, int16 of the same shape.
    """
    import torch

    from .workers import Workers

    # A step looks at a block and those around it, the sums at what is around that.
    reach = STEPS * 2 * grid.edges[0] + REACH
    with Workers(torch.device("cpu"), mask.size, between) as workers:
        for part in parts(mask.shape, _VOXELS_HELD, reach):
            around = part.around
            held = [mark.in_layers(around) for mark in marks]
            now = _after_steps(mask[around], intensities[around], grid.in_layers(around), display, held, workers.between)
            sums = neighbourhood_sums(tensor_of(now).view(torch.uint8), workers)
            yield part.layers, now[part.within], array_of(sums[part.within])


def _after_steps(
    mask: np.ndarray,
    intensities: np.ndarray,
    grid: BlockGrid,
    display: IntensityWindow,
    marks: Sequence[Mark],
    between: Between,
) -> np.ndarray:
    """The mask (K, J, I) after all steps."""
    between()
    shell = _shell_of(mask, grid)
    found = intensities[shell.voxels]
    known = shell.exist & np.isfinite(found)
    may_move = known & ~_held(marks, mask.shape)[shell.voxels]
    levels, before = _levels_of(found, display), known & mask[shell.voxels]
    inside, of_inside, of_all = before.copy(), _sums(before, levels), _sums(known, levels)
    around = shell.around(of_all, between)
    for _ in range(STEPS):
        divided = (of_inside[:, 0] > 0) & (of_inside[:, 0] < of_all[:, 0])
        edges = _strong_edges(shell.around(of_inside, between), around, divided[shell.moving])
        at = shell.moving[edges.which]
        moves = may_move[at] & (edges.join(levels[at]) != inside[at]) & edges.let_move(levels[at])
        if not moves.any():
            break
        inside[at] ^= moves
        of_inside[at] = _sums(inside[at], levels[at])
    now: np.ndarray = mask.copy()
    changed = np.nonzero(inside != before)
    now[shell.indices(changed)] = inside[changed]
    return now


class _Shell(NamedTuple):
    """The N blocks near a surface, and the M of them whose neighbourhoods contain both sides.

    Attributes:
        voxels: indices along K, J and I of the N blocks' voxels, of shapes (N, k, 1, 1), (N, 1, j, 1) and (N, 1, 1, i).
        exist: (N, k, j, i) bool, whether these voxels lie in the volume; indices of others are clipped to it.
        moving: (M,) indices of the M blocks among the N.
        neighbours: (27, M) indices of the blocks in their neighbourhoods; N for those outside the volume.
    """

    voxels: tuple[np.ndarray, ...]
    exist: np.ndarray
    moving: np.ndarray
    neighbours: np.ndarray

    def around(self, sums: np.ndarray, between: Between) -> np.ndarray:
        """Sums of the N blocks (N, 3), added up over the neighbourhoods of the M blocks, (M, 3) int32."""
        and_nothing = np.concatenate([sums, np.zeros((1, 3), dtype=np.int32)])
        added = np.zeros((len(self.moving), 3), dtype=np.int32)
        for neighbour in self.neighbours:
            between()
            added += and_nothing.take(neighbour, axis=0)
        return added

    def indices(self, some: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Indices along K, J and I in the volume, from indices into arrays of the shape (N, k, j, i)."""
        which, k, j, i = some
        along_k, along_j, along_i = self.voxels
        return along_k[which, k, 0, 0], along_j[which, 0, j, 0], along_i[which, 0, 0, i]


def _shell_of(mask: np.ndarray, grid: BlockGrid) -> _Shell:
    """The blocks near the surface of a mask (K, J, I)."""
    near = _has_both_sides(mask, grid)
    blocks = np.argwhere(_are_around(near))
    near = np.pad(near, 1)
    row = np.full(near.shape, len(blocks), dtype=np.int32)
    row[tuple(blocks.T + 1)] = np.arange(len(blocks))
    moving = np.flatnonzero(near[tuple(blocks.T + 1)])
    first = np.ravel_multi_index(tuple(blocks[moving].T), near.shape)
    steps = np.asarray(np.ravel_multi_index(tuple(np.indices((3, 3, 3)).reshape(3, -1)), near.shape))
    neighbours = np.stack([row.ravel()[first + step] for step in steps])
    return _Shell(*_voxels_of(blocks, mask.shape, grid), moving, neighbours)


def _voxels_of(blocks: np.ndarray, shape: tuple[int, ...], grid: BlockGrid) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """`voxels` and `exist` of `_Shell` for blocks (N, 3) in a volume of `shape` (K, J, I)."""
    voxels, exist = [], np.ones((1, 1, 1, 1), dtype=bool)
    for axis, (n, edge, before) in enumerate(zip(shape, grid.edges, grid.before, strict=True)):
        along = blocks[:, axis, None] * edge - before + np.arange(edge)
        along = np.expand_dims(along, [other for other in (1, 2, 3) if other != axis + 1])
        voxels.append(along.clip(0, n - 1))
        exist = exist & (along >= 0) & (along < n)
    return tuple(voxels), exist


def _has_both_sides(mask: np.ndarray, grid: BlockGrid) -> np.ndarray:
    """Whether the neighbourhoods of blocks contain inside and outside of a mask (K, J, I), bool (K', J', I')."""
    import torch

    sides = []
    for side in (mask, ~mask):
        filled = tensor_of(np.pad(side, [(n, 0) for n in grid.before])).view(torch.uint8)
        sides.append(_are_around(array_of(block_sums(filled, grid.edges)) > 0))
    both: np.ndarray = sides[0] & sides[1]
    return both


def _are_around(blocks: np.ndarray) -> np.ndarray:
    """Whether the neighbourhood of each block contains any of some blocks, both bool (K', J', I')."""
    import torch

    return array_of(window_sums(tensor_of(blocks).view(torch.uint8), 1)) > 0


def _held(marks: Sequence[Mark], shape: tuple[int, ...]) -> np.ndarray:
    """The voxels that marks determine, and that must not change, (K, J, I) bool."""
    held = np.zeros(shape, dtype=bool)
    for mark in marks:
        box, known = mark.known_of(shape)
        held[box] |= known
        held[mark.voxel_of(shape)] = True
    return held


class _StrongEdges(NamedTuple):
    """The E blocks in whose neighbourhoods the sides differ strongly.

    Attributes:
        which: their indices among the M blocks, (E,).
        halfway: the level halfway between both sides, (E,).
        brighter_inside: whether the inside is the brighter side, (E,).
        of_grey: whether one side is almost all grey and the other has hardly any grey, (E,).
    """

    which: np.ndarray
    halfway: np.ndarray
    brighter_inside: np.ndarray
    of_grey: np.ndarray

    def join(self, levels: np.ndarray) -> np.ndarray:
        """Whether voxels with these levels (E, k, j, i) belong inside."""
        halfway, brighter_inside = self.halfway[:, None, None, None], self.brighter_inside[:, None, None, None]
        return np.where(brighter_inside, levels > halfway, levels < halfway)

    def let_move(self, levels: np.ndarray) -> np.ndarray:
        """Whether voxels with these levels (E, k, j, i) may change sides."""
        may: np.ndarray = self.of_grey[:, None, None, None] | ~_is_grey(levels)
        return may


def _strong_edges(inside: np.ndarray, around: np.ndarray, divided: np.ndarray) -> _StrongEdges:
    """The blocks at which edges are strong.

    Args:
        inside: sums of the inside voxels of M neighbourhoods, (M, 3); see `_sums`.
        around: sums of all of their voxels, (M, 3).
        divided: (M,) bool, whether the block in the middle itself contains both sides, as in small structures.
    """
    share = inside[:, 0] / np.maximum(around[:, 0], 1)
    here = np.flatnonzero(divided | ((share >= SMALLEST_SHARE) & (share <= 1.0 - SMALLEST_SHARE)))
    of_inside, of_outside = inside[here], around[here] - inside[here]
    (level_inside, grey_inside), (level_outside, grey_outside) = ((of[:, 1:] / of[:, :1]).T for of in (of_inside, of_outside))
    strong = np.abs(level_inside - level_outside) > STRONG * _LEVELS_PER_WIDTH
    less, more = np.minimum(grey_inside, grey_outside), np.maximum(grey_inside, grey_outside)
    of_grey = (less <= HARDLY_GREY) & (more >= 1.0 - HARDLY_GREY)
    halfway = 0.5 * (level_inside + level_outside)
    return _StrongEdges(here[strong], halfway[strong], (level_inside > level_outside)[strong], of_grey[strong])


def _sums(voxels: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """For each block: number of `voxels` (N, k, j, i) bool, sum of their levels, and number of grey ones; (N, 3) int32."""
    within = 1, 2, 3
    sums = voxels.sum(within), np.where(voxels, levels, 0).sum(within), (voxels & _is_grey(levels)).sum(within)
    return np.stack(sums, axis=1).astype(np.int32)


def _levels_of(intensities: np.ndarray, display: IntensityWindow) -> np.ndarray:
    """Intensities of any shape as whole numbers from 0, int16; values that are not finite get arbitrary ones."""
    levels = intensities.astype(np.float64)
    levels -= display.low
    levels /= display.width
    np.nan_to_num(levels, copy=False)
    np.clip(levels, -_WIDTHS_AROUND, 1.0 + _WIDTHS_AROUND, out=levels)
    levels += _WIDTHS_AROUND
    levels *= _LEVELS_PER_WIDTH
    rounded: np.ndarray = np.rint(levels, out=levels).astype(np.int16)
    return rounded


def _is_grey(levels: np.ndarray) -> np.ndarray:
    """Whether levels lie in the display window, bool of the same shape."""
    black, white = _WIDTHS_AROUND * _LEVELS_PER_WIDTH, (_WIDTHS_AROUND + 1.0) * _LEVELS_PER_WIDTH
    grey: np.ndarray = (levels >= black) & (levels <= white)
    return grey
