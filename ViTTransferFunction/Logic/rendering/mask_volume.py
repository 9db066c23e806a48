"""Segments that are masks as one volume of structures: as maps, they go the way of all classes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.volumes.bounding_box import bounding_box, common_box
from ..core.volumes.geometry import Box, Geometry
from .class_membership import Shape, nearest_voxels
from .composition import MOST_ALONG_AXIS
from .intensity_levels import gray_levels
from .iso_surfaces import smooth_map_volume
from .mask_maps import ISO, mask_map

VOXEL_BUDGET = 12_000_000
"""Voxels that a picture is rendered from: as many as software OpenGL renders in a few seconds."""

FINEST_CELLS = 0.5
"""Voxels are not smaller than this part of the masks' finest spacing: there is no more to be seen."""

MARGIN_CELLS = 2
"""Cells around the masks, also beyond the volume, so that what its border cuts is closed."""


def mask_volume(
    geometry: Geometry,
    masks: Sequence[np.ndarray],
    opacities: Sequence[float],
    guides: Sequence[tuple[np.ndarray, float] | None] | None = None,
    intensities: tuple[np.ndarray, np.ndarray] | None = None,
    whole: bool = False,
) -> tuple[np.ndarray, Geometry]:
    """Segments as surfaces in a volume that just encloses them, or in the whole volume where what is around them is wanted.

    Args:
        geometry: the masks' grid.
        masks: (K, J, I) bool each; at least one has voxels.
        opacities: of the segments, in [0, 1]. Where two overlap, the more opaque one has the voxel.
        guides: for each segment, if there is one, a similarity map (K, J, I) and its iso value, by which its surface is placed
            between the voxels.
        intensities: (K, J, I) of all voxels, and grey levels for them (`intensity_levels`); None: neither the look of the
            segments nor that of what is around them depends on any.
        whole: whether what is around the segments is wanted too.

    Returns:
        (K', J', I', 4) uint8, a volume of structures (`composition`), and where its voxels lie.
    """
    part, box = _all_of(geometry) if whole else _part_with(geometry, masks)
    shape = _fine_shape(part)
    cells = part.resized(tuple(np.minimum(part.shape, shape).tolist()))
    order = sorted(range(len(masks)), key=lambda index: -opacities[index])
    taken = np.zeros(geometry.shape, dtype=bool)
    own = list(masks)
    for index in order:
        own[index] = masks[index] & ~taken
        taken |= masks[index]
    maps = (_map(mask, box, cells, guide) for mask, guide in zip(own, guides or [None] * len(masks), strict=True))
    composition = smooth_map_volume(maps, len(masks), ISO, shape, cells.spacing_mm[::-1].tolist())
    gray = None
    if intensities is not None:
        array, levels = intensities
        gray = gray_levels(_cut(array, box, mode="edge"), levels, shape)
    return composition.voxels(gray, [opacity > 0.0 for opacity in opacities]), part.resized(shape)


def _all_of(geometry: Geometry) -> tuple[Geometry, Box]:
    """All of a grid, and as a box, which reaches a little beyond it."""
    k, j, i = (slice(-MARGIN_CELLS, size + MARGIN_CELLS) for size in geometry.shape)
    return geometry.part((k, j, i)), (k, j, i)


def _part_with(geometry: Geometry, masks: Sequence[np.ndarray]) -> tuple[Geometry, Box]:
    """The part of the grid that holds all masks, and as a box, which reaches beyond the grid where they do nearly."""
    occupied = common_box([box for mask in masks if (box := bounding_box(mask)) is not None])
    k, j, i = (slice(extent.start - MARGIN_CELLS, extent.stop + MARGIN_CELLS) for extent in occupied)
    return geometry.part((k, j, i)), (k, j, i)


def _fine_shape(part: Geometry) -> Shape:
    """The shape of a grid of cubes, about, that fills the part's box."""
    within_budget_mm = float(np.cbrt(np.prod(part.extent_mm) / VOXEL_BUDGET))
    along_axis_mm = float(part.extent_mm.max()) / MOST_ALONG_AXIS
    spacing_mm = max(within_budget_mm, along_axis_mm, FINEST_CELLS * float(part.spacing_mm.min()))
    k, j, i = np.maximum(np.rint(part.extent_mm[::-1] / spacing_mm), 1).astype(int).tolist()
    return k, j, i


def _map(mask: np.ndarray, box: Box, cells: Geometry, guide: tuple[np.ndarray, float] | None) -> np.ndarray:
    """The map of a mask's part that lies in `box`, on a grid that fills the box, (K', J', I') uint8."""
    coarse = _nearest_cells(_cut(mask, box, mode="constant"), cells.shape)
    if guide is None:
        return mask_map(coarse, cells.spacing_mm)
    similarity, iso = guide
    similarity = nearest_voxels(_cut(np.nan_to_num(similarity), box, mode="edge"), cells.shape)
    return mask_map(coarse, cells.spacing_mm, similarity, iso)


def _nearest_cells(mask: np.ndarray, shape: Shape) -> np.ndarray:
    """A mask on a grid of fewer cells; one so small that it would fall between them all keeps those that it touches."""
    coarse = nearest_voxels(mask, shape)
    if mask.any() and not coarse.any():
        touched = (np.argwhere(mask) + 0.5) * np.array(shape) / mask.shape
        coarse = np.zeros(shape, dtype=bool)
        coarse[tuple(touched.astype(int).T)] = True
    return coarse


def _cut(array: np.ndarray, box: Box, mode: str) -> np.ndarray:
    """The part of an array in a box, continued as numpy's `pad` does in `mode` where that reaches beyond the array."""
    inner = tuple(slice(max(extent.start, 0), extent.stop) for extent in box)
    beyond = [(max(-extent.start, 0), max(extent.stop - size, 0)) for extent, size in zip(box, array.shape, strict=True)]
    cut: np.ndarray = np.pad(array[inner], beyond, mode=mode)  # type: ignore[call-overload]
    return cut
