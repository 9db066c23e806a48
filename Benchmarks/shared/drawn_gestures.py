"""A user who begins a structure by drawing in a slice that shows much of it: its longest diameter, or its outline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage
from skimage.measure import find_contours

from Benchmarks.shared.regions import Voxel, largest_component
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.volumes.geometry import body_scale

HAND_MM, HAND_SHARE = 1.5, 0.06
"""Standard deviation of where a person draws around where they mean to: along each axis of where a line ends, across an
outline; of a short line, or a narrow outline, such a share."""
WOBBLE_MM = 6.0
"""Along an outline, a hand errs to one side for about so long."""
LARGEST_HOLE = 0.1
"""Who draws once around something shows no hole in it; of its area, such a share is of no account."""
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
    k, shown = _shown(structure, random)
    pixel_mm = np.asarray(spacing_mm)[1:]
    ends = _by_hand(_longest_within(shown, pixel_mm), random)
    points = points_of_diameter(_in_volume(ends, k, spacing_mm), _scale(structure, spacing_mm))
    return _clicks(points, structure.shape, spacing_mm)


def drawn_outline(structure: np.ndarray, spacing_mm: Sequence[float], *seed: int) -> list[Click] | None:
    """What the outline of a structure in one slice stands for, as a person draws it.

    Args:
        structure: as for `drawn_diameter`.
        spacing_mm: as there.
        seed: as there.

    Returns:
        Its points; what is beyond the volume is left out. None where the structure has a hole in the slice, as a ring has.
    """
    outline = outline_mm(structure, spacing_mm, *seed)
    if outline is None:
        return None
    return _clicks(points_of_outline(outline, _scale(structure, spacing_mm)), structure.shape, spacing_mm)


def outline_mm(structure: np.ndarray, spacing_mm: Sequence[float], *seed: int) -> np.ndarray | None:
    """The outline itself, (N, 3) millimetres along (K, J, I) from the middle of the first voxel; see `drawn_outline`."""
    random = np.random.default_rng(seed)
    k, shown = _shown(structure, random)
    if ndimage.binary_fill_holes(shown).sum() > (1.0 + LARGEST_HOLE) * shown.sum():
        return None
    return _in_volume(_outline_by_hand(shown, np.asarray(spacing_mm)[1:], random), k, spacing_mm)


def _scale(structure: np.ndarray, spacing_mm: Sequence[float]) -> float:
    """Of lengths that are meant for bodies, in the volume that a structure is of."""
    return body_scale(float((np.asarray(spacing_mm) * structure.shape).max()))


def _shown(structure: np.ndarray, random: np.random.Generator) -> tuple[int, np.ndarray]:
    """The slice in which a person draws, and what it shows of the structure, (J, I) bool: its largest part."""
    part = largest_component(structure)
    areas = part.sum(axis=(1, 2))
    k = int(random.choice(np.flatnonzero(areas >= NEARLY_LARGEST * areas.max())))
    return k, largest_component(part[k : k + 1])[0]


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
    return ends + random.normal(0.0, min(HAND_MM, HAND_SHARE * length_mm), ends.shape)


def _outline_by_hand(shown: np.ndarray, pixel_mm: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Around a region (J, I) bool, along its edge, (N, 2) millimetres along (J, I)."""
    margin = int(np.ceil(4.0 * HAND_MM / pixel_mm.min()))
    padded = np.pad(shown, margin)
    # 0 at the edges of the region's pixels.
    depth = ndimage.distance_transform_edt(padded, sampling=pixel_mm) - ndimage.distance_transform_edt(
        ~padded, sampling=pixel_mm
    )
    error = ndimage.gaussian_filter(random.normal(size=depth.shape), WOBBLE_MM / pixel_mm)
    depth += error / error.std() * min(HAND_MM, HAND_SHARE * 2.0 * float(depth.max()))
    longest: np.ndarray = max(find_contours(depth, 0.0), key=len)
    return (longest[:-1] - margin) * pixel_mm


def _in_volume(drawn: np.ndarray, k: int, spacing_mm: Sequence[float]) -> np.ndarray:
    """What was drawn in slice k, (N, 2) millimetres, as (N, 3) millimetres along (K, J, I)."""
    placed: np.ndarray = np.insert(drawn, 0, k * spacing_mm[0], axis=1)
    return placed


def _clicks(points_mm: tuple[np.ndarray, np.ndarray], shape: tuple[int, ...], spacing_mm: Sequence[float]) -> list[Click]:
    """Points inside and outside, (N, 3) and (M, 3) millimetres along (K, J, I), as clicks into the volume."""
    inside, outside = points_mm
    clicks = [Click(_voxel(point_mm, np.asarray(spacing_mm)), True) for point_mm in inside]
    clicks += [Click(_voxel(point_mm, np.asarray(spacing_mm)), False) for point_mm in outside]
    return [click for click in clicks if all(0 <= n < size for n, size in zip(click.kji, shape, strict=True))]


def _voxel(point_mm: np.ndarray, spacing_mm: np.ndarray) -> Voxel:
    k, j, i = (int(n) for n in np.round(point_mm / spacing_mm))
    return k, j, i
