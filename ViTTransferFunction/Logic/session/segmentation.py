"""What becomes of classes: their labels, and of each how large it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.classes.class_request import ClassRequest
from ..core.volumes.geometry import Geometry
from .labels import count_labels


@dataclass(frozen=True)
class ClassResult:
    """What became of one class.

    Attributes:
        name: of the class.
        iso: the threshold that was used on the full-resolution map.
        voxels: how many voxels the segment has.
        millilitres: their volume.
        reaches_iso: whether its map reaches that threshold anywhere; if it does, a segment without voxels lost them to others.
    """

    name: str
    iso: float
    voxels: int
    millilitres: float
    reaches_iso: bool


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Labels of all classes.

    Attributes:
        labels: (K, J, I), 0 for background, 1 + index of the class elsewhere; uint8, or uint16 from 256 classes on.
        classes: one entry for each class, in order.
    """

    labels: np.ndarray
    classes: tuple[ClassResult, ...]


def segmentation_of(
    labels: np.ndarray, geometry: Geometry, requests: Sequence[ClassRequest], thresholds: Sequence[tuple[float, bool]]
) -> Segmentation:
    """The segmentation that a label map is.

    Args:
        labels: (K, J, I), see `Segmentation`.
        geometry: of the labels.
        requests: the classes.
        thresholds: of each class, the iso value that was used, and whether its map reaches that.
    """
    sizes = label_sizes(labels, geometry, len(requests))
    results = (
        ClassResult(request.name, iso, voxels, millilitres, reaches)
        for request, (iso, reaches), (voxels, millilitres) in zip(requests, thresholds, sizes, strict=True)
    )
    return Segmentation(labels, tuple(results))


def label_sizes(labels: np.ndarray, geometry: Geometry, count: int) -> list[tuple[int, float]]:
    """How many voxels carry each of the labels 1 to `count` in a label map (K, J, I), and how many millilitres these are."""
    voxel_ml = geometry.voxel_volume_mm3 / 1000.0
    return [(voxels, voxels * voxel_ml) for voxels in count_labels(labels, count)]
