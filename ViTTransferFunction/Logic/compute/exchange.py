"""What goes to and comes from a volume that is segmented in the compute process (`remote_segmentation`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.geometry import Geometry


@dataclass(frozen=True, eq=False)
class RemoteVolume:
    """What the compute process gets of a volume: voxels (K, J, I), unchecked, where they lie, and what users call it."""

    array: np.ndarray
    geometry: Geometry
    name: str


@dataclass(frozen=True)
class Estimate:
    """What features will cost: whether they are there already, memory, and megabytes to download first.

    Attributes:
        cached: whether they only have to be loaded.
        seconds: that computing them will take; None where that is not known.
        memory_bytes: that is in use while they are computed; of the features alone where that is not known.
        download_mb: of the model's weights, 0 where they are on this computer.
    """

    cached: bool
    seconds: float | None
    memory_bytes: int
    download_mb: int


@dataclass(frozen=True)
class Progressing:
    """How far the running work is: `done` of `total` steps of `what`; `seconds_left` is None until it can be told."""

    done: int
    total: int
    what: str
    seconds_left: float | None


@dataclass(frozen=True, eq=False)
class ShownMap:
    """A class's map, to be shown.

    Attributes:
        array: S_L (K', J', I') float32 in [0, 1], or the relevant box of S_H, (K, J, I) uint8 for 0 to 1.
        ijk_to_ras: (4, 4) of the array, in the volume's frame.
        iso: threshold that selects the class, in [0, 1].
    """

    array: np.ndarray
    ijk_to_ras: np.ndarray
    iso: float
