"""Other scans made of a labelled one: parts of it, thicker slices, larger voxels, more noise, fewer intensities.

Truth goes along: a new voxel belongs to what most of it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume
from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box
from ViTTransferFunction.Logic.core.volumes.geometry import Box
from ViTTransferFunction.Logic.core.volumes.volume import Volume

FILLED_SHARE = 0.25
"""Of the box of an organ-filling crop that is the organ: a random voxel of the background is in it often."""
KEPT_SHARE = 0.25
"""Of a structure's voxels that a crop has to hold for it to be annotated there."""
SOFT_TISSUE = (-160.0, 240.0)
"""Hounsfield units that scanners export where only soft tissue was asked for."""


def right_half(labelled: LabelledVolume) -> LabelledVolume:
    """The half of the body with the larger indices along I or the smaller ones, whichever is the patient's right."""
    shape = labelled.truth.shape
    middle = shape[2] // 2
    rightwards = labelled.volume.geometry.ijk_to_ras[0, 0] > 0
    right = slice(middle, shape[2]) if rightwards else slice(0, middle)
    return cropped(labelled, (slice(0, shape[0]), slice(0, shape[1]), right))


def filled_by(labelled: LabelledVolume, structures: Sequence[str]) -> LabelledVolume:
    """The largest box around structures, equally far from them on all sides in millimetres, that they fill to a quarter.

    Their bounding box, where they do not fill even that.
    """
    mask = np.isin(labelled.truth, [labelled.names.index(name) + 1 for name in structures])
    inner = bounding_box(mask)
    if inner is None:
        raise ValueError(f"there is no voxel of {', '.join(structures)} to crop around")
    box, voxels = inner, np.count_nonzero(mask)
    for margin_mm in range(1, 1000):
        larger = _padded(inner, margin_mm / np.array(labelled.spacing_mm), mask.shape)
        if voxels < FILLED_SHARE * np.prod([side.stop - side.start for side in larger]):
            break
        box = larger
    return cropped(labelled, box)


def _padded(box: Box, voxels: np.ndarray, shape: tuple[int, ...]) -> Box:
    margins = zip(box, voxels.astype(int), shape, strict=True)
    k, j, i = (slice(max(side.start - int(n), 0), min(side.stop + int(n), size)) for side, n, size in margins)
    return k, j, i


def cropped(labelled: LabelledVolume, box: Box) -> LabelledVolume:
    """A part of the scan, with the structures of which enough is in it."""
    before = np.bincount(labelled.truth.ravel(), minlength=len(labelled.names) + 1)
    after = np.bincount(labelled.truth[box].ravel(), minlength=len(labelled.names) + 1)
    kept = [label for label in range(1, len(before)) if after[label] and after[label] >= KEPT_SHARE * before[label]]
    volume = labelled.volume
    part = Volume(np.ascontiguousarray(volume.array[box]), volume.geometry.part(box), volume.name)
    return LabelledVolume(part, labelled.truth[box], labelled.names).only(kept)


def thick_slices(labelled: LabelledVolume, thickness_mm: float) -> LabelledVolume:
    """Slices of about this thickness, each the average over it."""
    k, j, i = labelled.truth.shape
    return _averaged(labelled, (round(k * labelled.spacing_mm[0] / thickness_mm), j, i))


def half_resolution(labelled: LabelledVolume) -> LabelledVolume:
    """Voxels twice as large within slices, each the average over its place."""
    k, j, i = labelled.truth.shape
    return _averaged(labelled, (k, j // 2, i // 2))


def _averaged(labelled: LabelledVolume, shape: tuple[int, int, int]) -> LabelledVolume:
    """So many voxels (K, J, I), each the average over its part of the scan's box."""
    volume = labelled.volume
    array = _means(volume.array, shape)
    if np.issubdtype(volume.array.dtype, np.integer):
        array = np.rint(array).astype(volume.array.dtype)
    largest_share, truth = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=labelled.truth.dtype)
    for label in range(len(labelled.names) + 1):
        share = _means(labelled.truth == label, shape)
        truth[share > largest_share] = label
        largest_share = np.maximum(share, largest_share)
    averaged = LabelledVolume(Volume(array, volume.geometry.resized(shape), volume.name), truth, labelled.names)
    return averaged.only([label for label in range(1, len(labelled.names) + 1) if (truth == label).any()])


def _means(array: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Means over equal parts of each axis, float32, of an array that is constant within voxels."""
    for axis, count in enumerate(shape):
        if count != array.shape[axis]:
            array = _means_along(array, axis, count)
    return array.astype(np.float32)


def _means_along(array: np.ndarray, axis: int, count: int) -> np.ndarray:
    along = np.moveaxis(array, axis, 0)
    summed = np.concatenate([np.zeros_like(along[:1], dtype=np.float64), np.cumsum(along, axis=0, dtype=np.float64)])
    borders = np.linspace(0.0, len(along), count + 1)
    before = np.minimum(borders.astype(int), len(along) - 1)
    rest = (borders - before)[:, None, None]
    until = summed[before] * (1.0 - rest) + summed[before + 1] * rest
    return np.moveaxis(np.diff(until, axis=0) * count / len(along), 0, axis)


def twice_the_noise(labelled: LabelledVolume) -> LabelledVolume:
    """Normal noise added, so that the standard deviation of all noise is twice the scan's own."""
    volume = labelled.volume
    added = np.sqrt(3.0) * noise(labelled) * np.random.default_rng(1).standard_normal(volume.shape)
    array = (volume.array + added).astype(np.float32)
    if np.issubdtype(volume.array.dtype, np.integer):
        array = np.rint(array).astype(np.int32)
    return LabelledVolume(Volume(array, volume.geometry, volume.name), labelled.truth, labelled.names)


def noise(labelled: LabelledVolume) -> float:
    """Standard deviation of what neighbouring voxels of the structures do not share (Donoho & Johnstone 1994).

    From the median of the finest diagonal Haar coefficients within slices, which edges hardly touch.
    """
    array = labelled.volume.array.astype(np.float32)
    diagonal = (array[:, :-1, :-1] - array[:, :-1, 1:] - array[:, 1:, :-1] + array[:, 1:, 1:]) / 2.0
    return float(np.median(np.abs(diagonal[labelled.truth[:, :-1, :-1] > 0])) / 0.6745)


def soft_tissue_only(labelled: LabelledVolume) -> LabelledVolume:
    """A CT exported in a window of soft tissue: 256 grey values, all else cut off."""
    low, high = SOFT_TISSUE
    array = np.rint(np.clip((labelled.volume.array - low) / (high - low), 0.0, 1.0) * 255.0).astype(np.uint8)
    return LabelledVolume(Volume(array, labelled.volume.geometry, labelled.volume.name), labelled.truth, labelled.names)
