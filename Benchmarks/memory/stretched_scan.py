"""A scan of any size that looks like a body: a labelled one, resampled to more voxels, with noise."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813
from scipy import ndimage

NOISE_HU = 12.0
NOISE_SLICES = 64
"""Noise is made for so many slices, and repeated, each time shifted."""
POINTS = 3
APART_VOXELS = 8


def write_stretched_scan(source: Path, size: Sequence[int], target: Path) -> None:
    """Write a scan resampled to `size` (I, J, K) voxels of 16 bits, which fill the same box."""
    scan = sitk.ReadImage(str(source))
    spacing = [step * n / m for step, n, m in zip(scan.GetSpacing(), scan.GetSize(), size, strict=True)]
    first = [0.5 * (fine / step) - 0.5 for step, fine in zip(scan.GetSpacing(), spacing, strict=True)]
    origin = scan.TransformContinuousIndexToPhysicalPoint(first)
    stretched = sitk.Resample(
        scan, size, sitk.Transform(), sitk.sitkLinear, origin, spacing, scan.GetDirection(), -1000.0, sitk.sitkInt16
    )
    array = sitk.GetArrayFromImage(stretched)
    noise = np.rint(np.random.default_rng(0).normal(0.0, NOISE_HU, (NOISE_SLICES, *array.shape[1:]))).astype(np.int16)
    for start in range(0, len(array), NOISE_SLICES):
        part = array[start : start + NOISE_SLICES]
        part += np.roll(noise[: len(part)], start, axis=1)
    noisy = sitk.GetImageFromArray(array)
    noisy.CopyInformation(stretched)
    sitk.WriteImage(noisy, str(target))


def write_points(labels: Path, structures: Mapping[str, Sequence[int]], target: Path) -> None:
    """Write annotations: a few points deep inside each structure, which is one or more labels of a label map."""
    image = sitk.ReadImage(str(labels))
    array = sitk.GetArrayFromImage(image)
    classes = []
    for name, values in structures.items():
        depth = ndimage.distance_transform_edt(np.isin(array, values))
        points = []
        for _ in range(POINTS):
            deepest = np.unravel_index(depth.argmax(), depth.shape)
            points.append(list(image.TransformIndexToPhysicalPoint([int(index) for index in reversed(deepest)])))
            depth[tuple(slice(max(index - APART_VOXELS, 0), index + APART_VOXELS + 1) for index in deepest)] = 0.0
        classes.append({"name": name, "positive": points})
    target.write_text(json.dumps({"coordinate_system": "LPS", "classes": classes}), encoding="utf-8")
