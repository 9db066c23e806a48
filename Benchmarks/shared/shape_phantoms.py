"""The paper's synthetic volumes, a sphere and a torus, of any size and with noise."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume

BRIGHTNESS = 100
"""Of a shape; around it is 0."""
Centre = tuple[float, float, float]
"""Along (K, J, I), as a share of the volume's edge."""


def sphere(size: int, centre: Centre = (0.5, 0.5, 0.5), radius: float = 0.3) -> np.ndarray:
    """(size, size, size) bool; the radius is a share of the edge."""
    k, j, i = _offsets(size, centre)
    return k**2 + j**2 + i**2 < radius**2


def torus(size: int, centre: Centre = (0.5, 0.5, 0.5), radius: float = 0.28, thickness: float = 0.1) -> np.ndarray:
    """(size, size, size) bool, lying across I: a ring of `radius` whose tube has the radius `thickness`; shares of the edge."""
    k, j, i = _offsets(size, centre)
    return (np.sqrt(k**2 + j**2) - radius) ** 2 + i**2 < thickness**2


def phantom_volume(inside: np.ndarray, name: str, noise: float = 8.0) -> Volume:
    """A volume (K, J, I) int16 of 1 mm voxels in which `inside` is bright, with noise of this standard deviation."""
    rng = np.random.default_rng(0)
    array = np.empty(inside.shape, dtype=np.int16)
    # Slice by slice, so that a large volume has no copy in floating point.
    for layer, mask in zip(array, inside, strict=True):
        layer[:] = np.rint(mask * BRIGHTNESS + rng.normal(0.0, noise, mask.shape))
    return Volume(array, Geometry(inside.shape, np.eye(4)), name)


def _offsets(size: int, centre: Centre) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """From the centre, along each axis, as shares of the edge; they broadcast."""
    along = (np.arange(size, dtype=np.float32) + 0.5) / size
    k, j, i = (along - np.float32(position) for position in centre)
    return k[:, None, None], j[:, None], i
