"""A scan's intensities as 256 grey levels, which is what a rendered volume has room for.

Levels are spent on what there is: half of them evenly over the range, half by how frequent intensities are. So those of soft
tissue are told apart although bone and metal are far away.
"""

from __future__ import annotations

import numpy as np

from ..core.volumes.bounding_box import whole_box
from ..core.volumes.geometry import Box
from ..core.volumes.intensity_window import finite_sample, percentile_window
from ..core.volumes.resampling import cell_positions, interpolated, planes_between
from ..core.volumes.volume import Volume
from .class_membership import Shape, nearest_voxels
from .lookup import looked_up

LEVELS = 256

OUTLIERS_PERCENT = 0.02
"""Of the voxels at either end of the intensities, which are not told apart."""

BINS = 4096


def intensity_levels(scan: Volume) -> np.ndarray:
    """The intensity that each grey level stands for, (256,) float64, increasing; between them, linear."""
    window = percentile_window(scan, OUTLIERS_PERCENT)
    edges = np.linspace(window.low, window.high, BINS + 1)
    counts, _ = np.histogram(finite_sample(scan), edges)
    frequent = np.concatenate([[0.0], np.cumsum(counts)]) / max(counts.sum(), 1)
    share = 0.5 * np.linspace(0.0, 1.0, BINS + 1) + 0.5 * frequent
    levels: np.ndarray = np.interp(np.linspace(0.0, share[-1], LEVELS), share, edges)
    return levels


def gray_levels(intensities: np.ndarray, levels: np.ndarray, shape: Shape, part: Box | None = None) -> np.ndarray:
    """Intensities as grey levels on a grid of another shape that fills the same box.

    Args:
        intensities: (K, J, I), of any real dtype.
        levels: (256,), as `intensity_levels` has them.
        shape: (K', J', I') of the grid.
        part: of the grid, whose levels are wanted; None: all of it.

    Returns:
        (K'', J'', I'') of the part, uint8.
    """
    part = part or whole_box(shape)
    coarse: Shape = tuple(np.minimum(shape, intensities.shape).tolist())
    if coarse == shape:
        return _levels_of(nearest_voxels(intensities, shape, part), levels)
    levelled = _levels_of(nearest_voxels(intensities, coarse), levels)
    k, j, i = (cell_positions(*counts) for counts in zip(coarse, shape, part, strict=True))
    planes = interpolated(levelled, [np.arange(len(levelled)), j, i])
    fine = np.empty((len(k), len(j), len(i)), dtype=np.uint8)
    places = ((int(position), position - int(position)) for position in np.clip(k, 0, len(planes) - 1).tolist())
    for plane, between in zip(fine, planes_between(planes, places), strict=True):
        np.copyto(plane, np.rint(between, out=between), casting="unsafe")
    return fine


def _levels_of(intensities: np.ndarray, levels: np.ndarray) -> np.ndarray:
    if intensities.dtype in (np.int16, np.uint16):
        # Each of the values once, not each of the voxels.
        values = np.arange(65536, dtype=np.uint16).view(intensities.dtype)
        return looked_up(_nearest_levels(values, levels), intensities.view(np.uint16))
    # Slice by slice, since interpolation takes eight bytes of each voxel.
    return np.stack([_nearest_levels(part, levels) for part in intensities])


def _nearest_levels(intensities: np.ndarray, levels: np.ndarray) -> np.ndarray:
    scaled = np.interp(np.nan_to_num(intensities, nan=levels[0]), levels, np.arange(LEVELS))
    nearest: np.ndarray = np.rint(scaled).astype(np.uint8)
    return nearest
