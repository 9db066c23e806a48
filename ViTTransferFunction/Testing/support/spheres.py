"""Where the three spheres of conftest lie, and requests for them."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.volume import Volume

Spheres = tuple[Volume, np.ndarray]
"""The volume and its labels 1, 2 and 3."""


def centre_ras(spheres: Spheres, label: int) -> np.ndarray:
    """Centre of a sphere, (1, 3) RAS millimetres."""
    volume, labels = spheres
    return volume.geometry.ijk_to_ras_points(np.argwhere(labels == label).mean(axis=0)[::-1])


def requests_of(spheres: Spheres, **fields: object) -> tuple[ClassRequest, ...]:
    """A class with one point for each sphere, and further fields for all."""
    return tuple(ClassRequest(f"sphere {n}", centre_ras(spheres, n), **fields) for n in (1, 2, 3))  # type: ignore[arg-type]
