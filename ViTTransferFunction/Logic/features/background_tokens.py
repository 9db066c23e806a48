"""Background tokens: a few patches represent all those that show nothing but the air around the body.

What surrounds a body fills a third to a half of most scans. Leaving it out altogether would change every other feature,
because attention sees the background and makes use of it. So every fourth patch of it along rows and columns is kept, and
counts for all those that it represents (`VisionTransformer.keys_of_tokens`): features inside the body then stay what they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..core.volumes.intensity_window import IntensityWindow

BACKGROUND_LEVEL = 0.15
"""Of the window's width, from below. A CT's lung window starts at −1000 HU, so that background ends at −880 HU,
below lung tissue."""
BACKGROUND_STRIDE = 4
"""One patch in `BACKGROUND_STRIDE`² stands for background: 2 does not help the body's features, and leaves four times as
many."""


@dataclass(frozen=True, eq=False)
class TokenSelection:
    """Which patches of a slice are run, and which of them represents each that is not.

    Attributes:
        places: (T,) int64, row · columns + column of the patches to run, in increasing order.
        multiplicity: (T,) int64, how many patches each represents, itself included.
        representative: (rows · columns,) int64, for each patch of the slice, which of the T represents it.
    """

    places: np.ndarray
    multiplicity: np.ndarray
    representative: np.ndarray


def select_tokens(background: np.ndarray) -> TokenSelection:
    """Choose the patches of a slice to run: all that are not background, and representatives of those that are.

    Args:
        background: (rows, columns) bool, the patches that show nothing but background.
    """
    rows, columns = np.indices(background.shape)
    middle = BACKGROUND_STRIDE // 2
    kept = background & (rows % BACKGROUND_STRIDE == middle) & (columns % BACKGROUND_STRIDE == middle)
    if not kept.any():
        # In slices of few rows, and where little background is, none of it may lie on that lattice.
        kept.flat[np.flatnonzero(background)[:: BACKGROUND_STRIDE**2]] = True
    places = np.flatnonzero(~background | kept)
    stand_in = np.arange(background.size).reshape(background.shape)
    if background.any():
        nearest = ndimage.distance_transform_edt(~kept, return_distances=False, return_indices=True)
        stand_in = np.where(background, nearest[0] * background.shape[1] + nearest[1], stand_in)
    representative = np.searchsorted(places, stand_in.ravel())
    return TokenSelection(places, np.bincount(representative, minlength=len(places)), representative)


def background_cells(array: np.ndarray, window: IntensityWindow, shape: tuple[int, int, int]) -> np.ndarray:
    """The cells that hold nothing but the background around the body.

    Background is dark, and reaches the volume's border: gas inside the body and dark tissue are none. Where
    the surroundings are bright, or textured, there is no background.

    Args:
        array: (K, J, I) intensities.
        window: in which it is dark (`NetworkChannels`).
        shape: number of cells along (K, J, I).

    Returns:
        (K', J', I') bool.
    """
    dark = np.empty(shape, dtype=bool)
    for layer, members in enumerate(cell_members(array.shape[0], shape[0])):
        # A window is an increasing function: the brightest voxel stays the brightest, and only it has to be shown in it.
        brightest = _brightest(array[members.start : members.stop])
        for axis in (0, 1):
            cells = cell_members(array.shape[1 + axis], shape[1 + axis])
            brightest = np.stack([_brightest(brightest.take(cell, axis=axis), axis) for cell in cells], axis=axis)
        dark[layer] = window.apply(brightest) <= BACKGROUND_LEVEL
    components, _ = ndimage.label(dark)
    faces = [components.take(end, axis=axis) for axis in range(3) for end in (0, -1)]
    outside = np.unique(np.concatenate([face.ravel() for face in faces]))
    return dark & np.isin(components, outside)


def _brightest(intensities: np.ndarray, axis: int = 0) -> np.ndarray:
    """The largest along an axis, in the same dtype; NaN only where there is nothing else."""
    if np.issubdtype(intensities.dtype, np.floating):
        return np.asarray(np.fmax.reduce(intensities, axis=axis))
    return np.asarray(intensities.max(axis=axis))


def cell_members(voxels: int, cells: int) -> list[range]:
    """The voxels along an edge that each cell touches, those on the border of two in both."""
    return [range(cell * voxels // cells, -(-(cell + 1) * voxels // cells)) for cell in range(cells)]
