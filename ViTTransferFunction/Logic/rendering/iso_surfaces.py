"""Every class as an iso-surface of its map, in one volume of structures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..core.system.progress import Progress, no_progress
from .class_membership import Map, Shape, finest_shape, memberships
from .composition import COMPOSING, MOST_ALONG_AXIS, Composition, shape_within_budget
from .smoothing import smoothed

VOXELS_FROM_CELLS = 6_000_000
"""Voxels up to which coarse maps are refined: enough for smooth surfaces, and fast enough to follow clicks."""

MOST_VOXELS_PER_CELL = 3
"""Along an axis; refining coarse maps further shows nothing more."""

SOFTNESS_VOXELS = 1.5

SMOOTH_SOFTNESS_VOXELS = 1.9
"""Of maps that are smooth, so that nothing else softens a class."""

SMOOTH_SURFACE = 0.38
"""Membership, of 1, at the surface that smooth maps of masks show. At 0.5 it would cut the corners of voxels, which are boxes:
masks would look smaller than they are, and thin parts break."""


def similarity_volume(
    maps: Sequence[Map],
    isos: Sequence[float],
    shape: Shape | None = None,
    progress: Progress = no_progress,
) -> Composition:
    """Every class as an iso-surface of its map; where classes overlap, cut as `memberships` says.

    Args:
        maps: of the same part of the volume, but possibly of different shapes.
        isos: for each map, the value at its surface, in (0, 1).
        shape: (K', J', I') of the volume, which fills the box of the maps; None: `similarity_shape`.
        progress: called with classes done; may raise `Cancelled`.
    """
    shape = shape or similarity_shape(maps)
    composition = Composition(shape, len(maps))
    for done, (index, membership) in enumerate(memberships(maps, isos, shape, [SOFTNESS_VOXELS] * len(maps))):
        progress(done, len(maps), COMPOSING)
        composition.add(membership.box, index, smoothed(membership.values, passes=2))
    return composition


def similarity_shape(maps: Sequence[Map]) -> Shape:
    """Whole voxels for each cell of the finest map, more than one if it is coarse."""
    shape = shape_within_budget(finest_shape(maps))
    per_cell = min(int(np.cbrt(VOXELS_FROM_CELLS / np.prod(shape))), MOST_VOXELS_PER_CELL, MOST_ALONG_AXIS // max(shape))
    per_cell = max(1, per_cell)
    k, j, i = (per_cell * cells for cells in shape)
    return k, j, i


def smooth_map_volume(
    maps: Iterable[np.ndarray], count: int, iso: float, shape: Shape, cell_sizes: Sequence[float]
) -> Composition:
    """Every class as an iso-surface of its map, of maps that are smooth already: thin parts need not be smoothed away.

    Classes do not compete as in `similarity_volume`: each is all that its map says.

    Args:
        maps: (K, J, I) each, all of one shape; taken one after the other, so that not all of them need be in memory at once.
        count: how many they are.
        iso: the value at the surface, in (0, 1).
        shape: (K', J', I') of the result, of about equally long voxels along all axes, not fewer than there are cells.
        cell_sizes: of the maps along K, J, I, in any unit.
    """
    depths = np.rint(np.interp(np.arange(256) / 255.0, [0.0, SMOOTH_SURFACE, 1.0], [0.0, 127.5, 255.0])).astype(np.uint8)
    composition = Composition(shape, count)
    for index, similarity in enumerate(maps):
        for _, membership in memberships([similarity], [iso], shape, [SMOOTH_SOFTNESS_VOXELS], cell_sizes):
            composition.add(membership.box, index, depths[membership.values])
    return composition
