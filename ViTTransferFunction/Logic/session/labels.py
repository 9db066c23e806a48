"""From similarity maps to labels: which class gets each voxel, and the parts that the user meant."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy import ndimage

from ..core.geometry import Geometry
from ..core.iso_proposals import SMALLEST_ISO


def assign_labels(maps: Iterable[tuple[np.ndarray, float]], shape: tuple[int, int, int]) -> np.ndarray:
    """Label each voxel with the class whose map exceeds its own iso value by the largest factor.

    Args:
        maps: for each class its map (K, J, I) in [0, 1] and its iso value; consumed one at a time, so that they need not all
            be in memory.
        shape: of the maps, (K, J, I).

    Returns:
        (K, J, I) uint16: 0 where no class reaches its iso value, else 1 + the index of the class. An exact tie stays with the
        class that came first.
    """
    labels = np.zeros(shape, dtype=np.uint16)
    best = np.ones(shape, dtype=np.float32)
    for label, (similarity, iso) in enumerate(maps, start=1):
        ratio = over_iso(similarity, iso)
        wins = (ratio > best) | ((labels == 0) & (ratio >= 1.0))
        labels[wins] = label
        best[wins] = ratio[wins]
    return labels


def over_iso(similarity: np.ndarray, iso: float) -> np.ndarray:
    """By which factor a map (any shape) exceeds its iso value: what classes compete by."""
    ratio: np.ndarray = similarity / np.float32(max(iso, SMALLEST_ISO))
    return ratio


def count_labels(labels: np.ndarray, count: int) -> list[int]:
    """How many voxels carry each of the labels 1 to `count` in a label map (K, J, I)."""
    # One label at a time: NumPy's bincount would first make eight bytes of each voxel.
    return [int(np.count_nonzero(labels == label)) for label in range(1, count + 1)]


def keep_annotated_components(labels: np.ndarray, label: int, geometry: Geometry, points_ras: np.ndarray) -> None:
    """Keep of one label only the connected components (26-neighbourhood) that hold a point; in place.

    Where no point lies in any component, the label is left as it is: better a visible surplus than a vanished segment.

    Args:
        labels: (K, J, I) label map, changed in place.
        label: which label.
        geometry: of the label map.
        points_ras: (N, 3) RAS millimetres.
    """
    box = ndimage.find_objects((labels == label).astype(np.uint8))
    if not box:
        return
    components, _ = ndimage.label(labels[box[0]] == label, structure=np.ones((3, 3, 3)))
    nearest = np.round(geometry.ras_to_ijk(points_ras)[:, ::-1]).astype(int) - [axis.start for axis in box[0]]
    inside = ((nearest >= 0) & (nearest < components.shape)).all(axis=1)
    kept = np.unique(components[tuple(nearest[inside].T)])
    kept = kept[kept > 0]
    if len(kept):
        labels[box[0]][(components > 0) & ~np.isin(components, kept)] = 0
