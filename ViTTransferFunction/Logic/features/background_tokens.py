"""Air costs nothing: patches that show none of the body are stood for by a few of their kind.

What surrounds a body fills a third to a half of most scans. Leaving it out altogether would change every other feature,
because attention sees the air and makes use of it. So every fourth patch of it along rows and columns is kept, and counts for
all those that it stands for (`VisionTransformer.keys_of_tokens`): features inside the body then stay what they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..core.intensity_window import ChannelWindows

AIR_LEVEL = 0.15
"""Of each window's width, from below. A CT's lung window starts at −1000 HU, so that air ends at −880 HU, below lung tissue."""
AIR_STRIDE = 4
"""One patch in `AIR_STRIDE`² stands for air: 2 does not help the body's features, and leaves four times as many."""


@dataclass(frozen=True, eq=False)
class TokenSelection:
    """Which patches of a slice are run, and which of them stands for each that is not.

    Attributes:
        places: (T,) int64, row · columns + column of the patches to run, in increasing order.
        counts: (T,) int64, how many patches each stands for, itself included.
        standing_for: (rows · columns,) int64, for each patch of the slice, which of the T stands for it.
    """

    places: np.ndarray
    counts: np.ndarray
    standing_for: np.ndarray


def select_tokens(air: np.ndarray) -> TokenSelection:
    """Choose the patches of a slice to run: all that are not air, and representatives of those that are.

    Args:
        air: (rows, columns) bool, the patches that show nothing but air.
    """
    rows, columns = np.indices(air.shape)
    middle = AIR_STRIDE // 2
    representative = air & (rows % AIR_STRIDE == middle) & (columns % AIR_STRIDE == middle)
    if not representative.any():
        representative = air
    places = np.flatnonzero(~air | representative)
    stand_in = np.arange(air.size).reshape(air.shape)
    if air.any():
        nearest = ndimage.distance_transform_edt(~representative, return_distances=False, return_indices=True)
        stand_in = np.where(air, nearest[0] * air.shape[1] + nearest[1], stand_in)
    standing_for = np.searchsorted(places, stand_in.ravel())
    return TokenSelection(places, np.bincount(standing_for, minlength=len(places)), standing_for)


def air_cells(array: np.ndarray, windows: ChannelWindows, shape: tuple[int, int, int]) -> np.ndarray:
    """The cells that hold nothing but the air around the body.

    Air is dark in every window, and reaches the volume's border: gas inside the body and dark tissue are no air. Where
    the surroundings are bright, or textured, there is none.

    Args:
        array: (K, J, I) intensities.
        windows: in which the network sees them.
        shape: number of cells along (K, J, I).

    Returns:
        (K', J', I') bool.
    """
    dark = np.empty(shape, dtype=bool)
    for layer, members in enumerate(cell_members(array.shape[0], shape[0])):
        # Layer by layer, so that no copy of the volume is made.
        slab = array[members.start : members.stop]
        brightest = np.max([window.apply(slab).max(axis=0) for window in set(windows)], axis=0)
        for axis in (0, 1):
            cells = cell_members(array.shape[1 + axis], shape[1 + axis])
            brightest = np.stack([brightest.take(cell, axis=axis).max(axis=axis) for cell in cells], axis=axis)
        dark[layer] = brightest <= AIR_LEVEL
    components, _ = ndimage.label(dark)
    faces = [components.take(end, axis=axis) for axis in range(3) for end in (0, -1)]
    outside = np.unique(np.concatenate([face.ravel() for face in faces]))
    return dark & np.isin(components, outside)


def cell_members(voxels: int, cells: int) -> list[range]:
    """The voxels along an edge that each cell touches, those on the border of two in both."""
    return [range(cell * voxels // cells, -(-(cell + 1) * voxels // cells)) for cell in range(cells)]
