"""How well a segmentation agrees with the truth: overlap of the volumes, and agreement of the surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box

SURFACE_TOLERANCE_MM = 2.0
"""Distance between surfaces that two careful readers would not argue about."""


@dataclass(frozen=True)
class SegmentationMetrics:
    """Agreement of one structure with the truth, each number from 0 (none) to 1 (perfect).

    Attributes:
        dice: 2 |A ∩ B| / (|A| + |B|).
        iou: |A ∩ B| / |A ∪ B|.
        precision: share of the prediction that is true.
        recall: share of the truth that was found.
        surface_dice: see `surface_dice`, at `SURFACE_TOLERANCE_MM`.
    """

    dice: float
    iou: float
    precision: float
    recall: float
    surface_dice: float


def segmentation_metrics(predicted: np.ndarray, truth: np.ndarray, spacing_mm: Sequence[float]) -> SegmentationMetrics:
    """Compare a predicted structure with the true one.

    Where both are empty they agree, and every number is 1; where one is empty, every number is 0.

    Args:
        predicted: (K, J, I) bool.
        truth: (K, J, I) bool.
        spacing_mm: of the voxels, along (K, J, I).

    Raises:
        ValueError: the shapes differ.
    """
    if predicted.shape != truth.shape:
        raise ValueError(f"prediction of shape {predicted.shape} cannot be compared with a truth of shape {truth.shape}")
    common = int(np.count_nonzero(predicted & truth))
    found, wanted = int(np.count_nonzero(predicted)), int(np.count_nonzero(truth))
    return SegmentationMetrics(
        dice=_share(2 * common, found + wanted),
        iou=_share(common, found + wanted - common),
        precision=_share(common, found, when_empty=wanted == 0),
        recall=_share(common, wanted, when_empty=found == 0),
        surface_dice=surface_dice(predicted, truth, spacing_mm),
    )


def dice(predicted: np.ndarray, truth: np.ndarray) -> float:
    """2 |A ∩ B| / (|A| + |B|) of two masks (K, J, I) bool; 1 where both are empty."""
    common = int(np.count_nonzero(predicted & truth))
    return _share(2 * common, int(np.count_nonzero(predicted)) + int(np.count_nonzero(truth)))


def mean_dice(labels: np.ndarray, truth: np.ndarray, structures: int) -> float:
    """Mean of `dice` over the structures of two label maps (K, J, I), whose labels are 1 … `structures`."""
    return float(np.mean([dice(labels == label, truth == label) for label in range(1, structures + 1)]))


def surface_dice(
    predicted: np.ndarray, truth: np.ndarray, spacing_mm: Sequence[float], tolerance_mm: float = SURFACE_TOLERANCE_MM
) -> float:
    """Normalised surface Dice (Nikolov et al. 2018): the share of both surfaces' area that lies near the other surface.

    A surface consists of the faces between voxels inside and outside, each with its own area, so that anisotropic voxels count
    rightly; beyond the volume is outside. Distances are those between centres of faces.

    Args:
        predicted: (K, J, I) bool.
        truth: (K, J, I) bool.
        spacing_mm: of the voxels, along (K, J, I).
        tolerance_mm: how far apart surfaces may be and still agree.
    """
    box = bounding_box(predicted | truth)
    if box is None:
        return 1.0
    surfaces = [_surface(mask[box], np.asarray(spacing_mm, dtype=float)) for mask in (predicted, truth)]
    if any(len(area) == 0 for _, area in surfaces):
        return 0.0
    (centres_a, area_a), (centres_b, area_b) = surfaces
    near_a = _near(centres_a, centres_b, tolerance_mm)
    near_b = _near(centres_b, centres_a, tolerance_mm)
    return float(area_a[near_a].sum() + area_b[near_b].sum()) / float(area_a.sum() + area_b.sum())


def surface_distances_mm(predicted: np.ndarray, truth: np.ndarray, spacing_mm: Sequence[float]) -> np.ndarray:
    """Distance from every face of either surface to the other surface, (faces of both,) millimetres; see `surface_dice`.

    Args:
        predicted: (K, J, I) bool, not empty.
        truth: (K, J, I) bool, not empty.
        spacing_mm: of the voxels, along (K, J, I).
    """
    (centres_a, _), (centres_b, _) = (_surface(mask, np.asarray(spacing_mm, dtype=float)) for mask in (predicted, truth))
    return np.concatenate([cKDTree(centres_b).query(centres_a)[0], cKDTree(centres_a).query(centres_b)[0]])


def _share(part: int, whole: int, when_empty: bool = True) -> float:
    return part / whole if whole else float(when_empty)


def _surface(mask: np.ndarray, spacing_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres (N, 3) in millimetres along (K, J, I), and areas (N,) in mm², of the faces of a mask."""
    padded = np.pad(mask, 1).astype(np.int8)
    centres, areas = [], []
    for axis in range(3):
        faces = np.argwhere(np.diff(padded, axis=axis)).astype(float)
        # A difference at index n lies between voxels n and n + 1.
        faces[:, axis] += 0.5
        centres.append(faces * spacing_mm)
        areas.append(np.full(len(faces), np.prod(np.delete(spacing_mm, axis))))
    return np.concatenate(centres), np.concatenate(areas)


def _near(points: np.ndarray, others: np.ndarray, tolerance_mm: float) -> np.ndarray:
    """(N,) bool: whether each point has one of the others within the tolerance."""
    # The tree's bound is exclusive; rounding must not decide about a distance of exactly the tolerance.
    distance, _ = cKDTree(others).query(points, distance_upper_bound=tolerance_mm * (1.0 + 1e-9) + 1e-9)
    return np.isfinite(distance)
