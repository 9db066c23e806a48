"""Every class as an iso-surface of its map, as a volume of colours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..core.colors import Color
from ..core.progress import Progress, no_progress
from .class_membership import Shape, finest_shape, memberships
from .codes import class_codes
from .composition import COMPOSING, Composition, shape_within_budget

VOXELS_FROM_CELLS = 6_000_000
"""Voxels up to which coarse maps are refined: enough for smooth surfaces, and fast enough to follow clicks."""

MOST_VOXELS_PER_CELL = 3
"""Along an axis; refining coarse maps further shows nothing more."""

SMOOTH_RAMP = (0.02, 0.3, 0.73, 1.0)
"""Of an opaque class whose map is smooth: at a membership of 0.5 it is already opaque, so that it looks as large as it is, and
thin parts are seen."""

OPAQUE_SOFTNESS_VOXELS, TRANSLUCENT_SOFTNESS_VOXELS = 1.5, 3.0

SMOOTH_SOFTNESS_VOXELS = 1.9
"""Of maps that are smooth, so that nothing else softens an opaque class."""


def similarity_rgba(
    maps: Sequence[np.ndarray],
    isos: Sequence[float],
    colors: Sequence[Color],
    opacities: Sequence[float],
    progress: Progress = no_progress,
) -> np.ndarray:
    """Every class as an iso-surface of its map; where classes overlap, cut as `memberships` says.

    Args:
        maps: (K, J, I) each, float32 in [0, 1] or uint8 with 255 for 1. Where their shapes differ, they fill the same box.
        isos: for each map, the value at its surface, in (0, 1).
        colors: of the surfaces.
        opacities: of the surfaces, in [0, 1]; a class of opacity 0 is not seen but keeps its place.
        progress: called with classes done; may raise `Cancelled`.

    Returns:
        (K', J', I', 4) uint8, colours and codes; fills the box of the maps (`Geometry.resized` says where it lies).
    """
    shape = _refined_shape(shape_within_budget(finest_shape(maps)))
    composition = Composition(shape, len(maps))
    softness = [OPAQUE_SOFTNESS_VOXELS if opacity == 1.0 else TRANSLUCENT_SOFTNESS_VOXELS for opacity in opacities]
    for done, (index, membership) in enumerate(memberships(maps, isos, opacities, shape, softness)):
        progress(done, len(maps), COMPOSING)
        if opacities[index] > 0.0:
            composition.add(membership.box, index, class_codes(membership.values, opacities[index], passes=2))
    return composition.rgba(colors)


def smooth_map_rgba(
    maps: Iterable[np.ndarray],
    iso: float,
    colors: Sequence[Color],
    opacities: Sequence[float],
    shape: Shape,
    cell_sizes: Sequence[float],
) -> np.ndarray:
    """Every class as an iso-surface of its map, of maps that are smooth already: thin parts need not be smoothed away.

    Classes do not compete as in `similarity_rgba`: each is all that its map says. Of two that overlap, the more opaque shows.

    Args:
        maps: (K, J, I) each, all of one shape; taken one after the other, so that not all of them need be in memory at once.
        iso: the value at the surface, in (0, 1).
        colors: of the surfaces.
        opacities: of the surfaces, in [0, 1].
        shape: (K', J', I') of the result, of about equally long voxels along all axes, not fewer than there are cells.
        cell_sizes: of the maps along K, J, I, in any unit.

    Returns:
        (K', J', I', 4) uint8, colours and codes; fills the box of the maps.
    """
    composition = Composition(shape, len(colors))
    for index, (similarity, opacity) in enumerate(zip(maps, opacities, strict=True)):
        softness = SMOOTH_SOFTNESS_VOXELS if opacity == 1.0 else TRANSLUCENT_SOFTNESS_VOXELS
        for _, membership in memberships([similarity], [iso], [opacity], shape, [softness], cell_sizes):
            if opacity > 0.0:
                composition.add(
                    membership.box, index, class_codes(membership.values, opacity, passes=0, opaque_ramp=SMOOTH_RAMP)
                )
    return composition.rgba(colors)


def _refined_shape(shape: Shape) -> Shape:
    """Whole voxels for each cell, more than one if the map is coarse."""
    per_cell = max(1, min(int(np.cbrt(VOXELS_FROM_CELLS / np.prod(shape))), MOST_VOXELS_PER_CELL))
    k, j, i = (per_cell * cells for cells in shape)
    return k, j, i
