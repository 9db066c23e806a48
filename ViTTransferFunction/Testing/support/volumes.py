"""Volumes of a given content, where it does not matter where they lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation
from ViTTransferFunction.Logic.core.volumes.volume import Volume


def volume_of(array: np.ndarray, spacing_ijk: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Volume:
    """A volume with the content of `array` (K, J, I), its first voxel at the origin and its axes those of the patient."""
    return Volume(array, Geometry(array.shape, np.diag([*spacing_ijk, 1.0])))


def write_two_structures(path: Path) -> None:
    """A small scan of two structures, as a file; IJK (6, 8, 6) lies in one, and (14, 8, 6) in the other."""
    array = np.zeros((12, 16, 20), dtype=np.float32)
    array[3:9, 4:12, 4:9], array[3:9, 4:12, 12:17] = 100.0, 200.0
    image = sitk.GetImageFromArray(array + np.random.default_rng(0).normal(0, 1, array.shape).astype(np.float32))
    image.SetSpacing([2.0, 2.0, 3.0])
    sitk.WriteImage(image, str(path))


def stored_as(volume: Volume, stored: Orientation) -> Volume:
    """The same scan in the same place with its voxels in the order of `stored.to_canonical`."""
    array = np.ascontiguousarray(stored.to_canonical(volume.array))
    matrix = np.eye(4)
    first = np.zeros(3)
    for axis, (source, mirrored) in enumerate(zip(stored.order, stored.mirrored, strict=True)):
        matrix[:3, 2 - axis] = volume.geometry.ijk_to_ras[:3, 2 - source] * (-1.0 if mirrored else 1.0)
        first[2 - source] = array.shape[axis] - 1.0 if mirrored else 0.0
    matrix[:3, 3] = volume.geometry.ijk_to_ras_points(first[None])[0]
    return Volume(array, Geometry(array.shape, matrix), volume.name)
