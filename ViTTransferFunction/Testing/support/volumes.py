"""Volumes of a given content, where it does not matter where they lie."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.volume import Volume


def volume_of(array: np.ndarray, spacing_ijk: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Volume:
    """A volume with the content of `array` (K, J, I), its first voxel at the origin and its axes those of the patient."""
    return Volume(array, Geometry(array.shape, np.diag([*spacing_ijk, 1.0])))
