"""A user who begins a structure by drawing its diameter: a line across it, the longest in a slice that shows much of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from Benchmarks.shared.regions import Voxel, largest_component
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.Logic.core.diameter_points import points_of_diameter

END_MM, END_SHARE = 1.5, 0.06
"""Standard deviation along each axis of where a person ends a line around where they mean to; of a short line, such a share."""
NEARLY_LARGEST = 0.9
"""A person stops at a slice that shows about as much as any; of the largest area."""
MOST_ENDS = 200
"""Places on an outline that are looked at, evenly along it."""
_PLACES = (np.arange(32) + 0.5) / 32
"""Where along a line it is looked at whether it lies in the structure."""

Ends = np.ndarray
"""(2, 2) millimetres in a slice, along (J, I) from the middle of its first voxel."""


def drawn_diameter(structure: np.ndarray, spacing_mm: Sequence[float], *seed: int) -> list[Click]:
    """What the longest diameter of a structure stands for, as a person draws it.

    Args:
        structure: (K, J, I) bool, of at least one voxel; slices are drawn in as they are stored, along K.
        spacing_mm: of the voxels, along (K, J, I).
        seed: non-negative integers, such as the numbers of the path and of the class; the same are the same person.

    Returns:
        Its points; what is beyond the volume is left out.
    """
    random = np.random.default_rng(seed)
    part = largest_component(structure)
    areas = part.sum(axis=(1, 2))
    k = int(random.choice(np.flatnonzero(areas >= NEARLY_LARGEST * areas.max())))
    shown = largest_component(part[k : k + 1])[0]
    ends = _by_hand(_longest_within(shown, np.asarray(spacing_mm)[1:]), random)
    return _clicks(ends, k, structure.shape, np.asarray(spacing_mm))


def _longest_within(shown: np.ndarray, pixel_mm: np.ndarray) -> Ends:
    """The longest line from edge to edge that does not leave a region (J, I) bool."""
    outline = np.argwhere(shown & ~ndimage.binary_erosion(shown))
    ends_mm = outline[np.unique(np.linspace(0, len(outline) - 1, MOST_ENDS).astype(int))] * pixel_mm
    first, second = np.triu_indices(len(ends_mm), 1)
    lengths = np.linalg.norm(ends_mm[second] - ends_mm[first], axis=1)
    for index in np.argsort(-lengths, kind="stable"):
        ends = ends_mm[[first[index], second[index]]]
        along = np.round((ends[0] + _PLACES[:, None] * (ends[1] - ends[0])) / pixel_mm).astype(int)
        if shown[tuple(along.T)].all():
            return ends
    # Of a pixel, its edges are all there is.
    return np.stack([ends_mm[0] - pixel_mm / 2, ends_mm[0] + pixel_mm / 2])


def _by_hand(ends: Ends, random: np.random.Generator) -> Ends:
    length_mm = float(np.linalg.norm(ends[1] - ends[0]))
    return ends + random.normal(0.0, min(END_MM, END_SHARE * length_mm), ends.shape)


def _clicks(ends: Ends, k: int, shape: tuple[int, ...], spacing_mm: np.ndarray) -> list[Click]:
    inside, outside = points_of_diameter(np.insert(ends, 0, k * spacing_mm[0], axis=1))
    clicks = [Click(_voxel(point_mm, spacing_mm), True) for point_mm in inside]
    clicks += [Click(_voxel(point_mm, spacing_mm), False) for point_mm in outside]
    return [click for click in clicks if all(0 <= n < size for n, size in zip(click.kji, shape, strict=True))]


def _voxel(point_mm: np.ndarray, spacing_mm: np.ndarray) -> Voxel:
    k, j, i = (int(n) for n in np.round(point_mm / spacing_mm))
    return k, j, i
