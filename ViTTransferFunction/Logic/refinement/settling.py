"""The surface of a refined map, settled: smooth, along the image's edges, and on the right side of the user's points.

The bilateral solver reads each voxel's answer by that voxel's intensity, and so writes the scan's noise into the surface; where
a map ends before its structure does, nothing carries it on; and a point that its own cell speaks against may be left on the
wrong side. Threshold dynamics (`threshold_dynamics`) put all three right. What is half lung and half tissue is like neither to
them; there the surface moves halfway up the edge afterwards (`half_height`).
"""

from __future__ import annotations

import numpy as np

from ..core.classes.iso_proposals import LARGER, SMALLER
from ..core.system.progress import Between, nothing_between
from ..core.volumes.bounding_box import bounding_box, common_part, grown, out_of, within
from ..core.volumes.geometry import Box
from ..core.volumes.intensity_window import IntensityWindow
from ..core.volumes.volume import Volume
from ..core.volumes.voxel_map import VoxelMap
from .half_height import BlockGrid, at_half_height
from .neighbourhood_sums import WHOLE
from .refinement import cell_voxels, class_window, surroundings
from .threshold_dynamics import Mark, settled

MARKED_CELLS = 0.25
"""So far around a point, in feature cells, what it says is taken to hold."""


def settle(
    voxels: VoxelMap,
    volume: Volume,
    display: IntensityWindow,
    positive_ras: np.ndarray,
    negative_ras: np.ndarray,
    iso: float,
    between: Between = nothing_between,
) -> VoxelMap:
    """Let the surface of a refined map settle.

    Voxels that change sides get values beside the threshold, the farther from it the more their neighbourhood is of their new
    side: a smaller or larger size takes them back in that order. All others keep theirs, and so does all that is not held.

    Args:
        voxels: S_H, from `refine`.
        volume: the intensities.
        display: the window in which a person would look at them (`display_window`).
        positive_ras: (N, 3) RAS millimetres, points on the structure, N ≥ 1.
        negative_ras: (M, 3), points that are not on it, M ≥ 0.
        iso: threshold that selects the structure in its usual size. Other sizes are those of the settled map: each settled by
            itself, a larger one could become the smaller.
        between: called between steps; may raise `Cancelled`.

    Returns:
        The settled map. It holds the same array, whose values have changed.
    """
    threshold = np.float32(iso)
    box = _box_around(voxels, threshold)
    if box is None:
        return voxels
    part = voxels.held[within(box, voxels.box)]
    intensities, window = volume.array[box], class_window(volume, display, positive_ras)
    marks = [*_marks(negative_ras, False, box, volume, voxels), *_marks(positive_ras, True, box, volume, voxels)]
    smooth = np.concatenate(list(settled(part >= threshold, intensities, window, marks, between)))
    grid = BlockGrid.of(volume.geometry, box)
    for layers, now, sums in at_half_height(smooth, intensities, grid, display, marks, between):
        _change_sides(part[layers], now, sums, threshold)
    return voxels.changed_in(box)


def _box_around(voxels: VoxelMap, threshold: np.float32) -> Box | None:
    """The part of the volume in which a surface may move: what is held of its box and a margin; None where there is none."""
    reached = voxels.box_above(float(threshold))
    searched = None if reached is None else common_part(reached, voxels.box)
    if searched is None:
        return None
    inside = bounding_box(voxels.held[within(searched, voxels.box)] >= threshold)
    if inside is None:
        return None
    return grown(out_of(inside, searched), surroundings(voxels.shape, voxels.coarse.shape), voxels.box)


def _change_sides(part: np.ndarray, now: np.ndarray, sums: np.ndarray, threshold: np.float32) -> None:
    """Give voxels of a map (K, J, I) that changed sides values on their new one; see `at_half_height` for `now` and `sums`."""
    before = part >= threshold
    joined, left = now & ~before, before & ~now
    # From the threshold up to that of the smaller proposal, and down to that of the larger one.
    surrounded, alone = np.maximum(2.0 * _share(sums[joined]) - 1.0, 0.0), np.maximum(1.0 - 2.0 * _share(sums[left]), 0.0)
    part[joined] = np.minimum(threshold * (1.0 + (SMALLER - 1.0) * surrounded), 1.0)
    part[left] = np.minimum(threshold * (1.0 - (1.0 - LARGER) * alone), np.nextafter(threshold, np.float32(0.0)))


def _share(sums: np.ndarray) -> np.ndarray:
    """How much of neighbourhoods is inside, in [0, 1], float32."""
    share: np.ndarray = np.divide(sums, WHOLE, dtype=np.float32)
    return share


def _marks(points_ras: np.ndarray, inside: bool, box: Box, volume: Volume, voxels: VoxelMap) -> list[Mark]:
    """What points (N, 3) say of places in a box of the volume.

    Of hundreds of points of other classes, few say anything of it.
    """
    radii = MARKED_CELLS * np.array(cell_voxels(voxels.shape, voxels.coarse.shape))
    # A point on a face of the volume, or rounded to a little beyond, lies in the voxel before it.
    faces = np.array(volume.shape) - 0.5
    in_volume = np.clip(volume.geometry.off_borders(points_ras), -0.5, np.nextafter(faces, 0.0))
    centres = in_volume - [extent.start for extent in box]
    # The voxel of a point is marked however small the radii are.
    reach = np.maximum(radii, 1.0)
    last = np.array([extent.stop - extent.start - 1 for extent in box])
    near = ((centres >= -reach) & (centres <= last + reach)).all(axis=1)
    radius_k, radius_j, radius_i = radii.tolist()
    return [Mark((k, j, i), (radius_k, radius_j, radius_i), inside) for k, j, i in centres[near].tolist()]
