"""The part of a full-resolution map that matters: the box around its iso-surface, in bytes.

A structure fills a small part of a volume. Its box, at one byte a voxel, is hundreds of times smaller than the map, and small
enough to be handed from process to process and shown at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.classes.class_map import FULL_SCALE, NEAR_SHARE_OF_ISO, ClassMap, box_above
from ..core.classes.class_request import ClassRequest
from ..core.volumes.bounding_box import grown, out_of, whole_box
from ..core.volumes.geometry import Box, Geometry
from ..core.volumes.voxel_map import VoxelMap
from .refined_map import RefinedMap

MARGIN_VOXELS = 2


@dataclass(frozen=True, eq=False)
class MapCrop:
    """A box of a class's map.

    Attributes:
        array: (K, J, I) of the box, uint8, similarity times 255.
        box: where the box lies in the volume's array.
        iso: threshold that selects the class, in [0, 1].
    """

    array: np.ndarray
    box: Box
    iso: float

    def on(self, geometry: Geometry) -> ClassMap:
        """The crop as the map of a part of the volume, which has this geometry."""
        return ClassMap(self.array, geometry.part(self.box), self.iso)


class SegmentCrops:
    """The maps by which segments are shown: of each class, only what its segment has."""

    def __init__(self) -> None:
        self._crops: list[MapCrop] = []

    def take(self, request: ClassRequest, full: RefinedMap) -> None:
        """Keep of the next class's map what matters; an `on_map` of `SegmentationSession.segment`."""
        self._crops.append(crop_voxel_map(full.voxels, full.iso))

    def of(self, labels: np.ndarray) -> tuple[MapCrop, ...]:
        """The crops of all classes, given the `labels` (K, J, I) of the volume that came of their maps."""
        return tuple(restricted(crop, labels, label) for label, crop in enumerate(self._crops, start=1))


def crop_map(similarity: np.ndarray, iso: float) -> MapCrop:
    """Cut the map (K, J, I) in [0, 1] down to the box of its iso-surface and two voxels around it."""
    # Where nothing is above, a box all the same: two voxels, so that it has an extent.
    box = box_above(similarity, NEAR_SHARE_OF_ISO * iso, MARGIN_VOXELS) or (slice(0, 2),) * 3
    part = similarity[box]
    array = np.empty(part.shape, dtype=np.uint8)
    # Plane by plane: in four bytes a voxel, twice, a long structure's box would be more than the volume.
    for plane, similarities in zip(array, part, strict=True):
        plane[...] = np.rint(similarities * np.float32(FULL_SCALE))
    return MapCrop(array, box, iso)


def crop_voxel_map(voxels: VoxelMap, iso: float) -> MapCrop:
    """As `crop_map`, of a map that is not all in memory."""
    reaching = voxels.box_above(NEAR_SHARE_OF_ISO * iso) or (slice(0, 0),) * 3
    around = grown(reaching, (MARGIN_VOXELS,) * 3, whole_box(voxels.shape))
    crop = crop_map(voxels.part(around), iso)
    return MapCrop(crop.array, out_of(crop.box, around), crop.iso)


def restricted(crop: MapCrop, labels: np.ndarray, label: int) -> MapCrop:
    """The crop whose iso-surface encloses nothing but the voxels that carry `label` in `labels` (K, J, I) of the volume.

    Other classes may have won the rest, or it was dropped as a part without a click.
    """
    threshold = int(np.ceil(crop.iso * FULL_SCALE))
    inside = labels[crop.box] == label
    array = np.where(inside, np.maximum(crop.array, threshold), np.minimum(crop.array, max(threshold - 1, 0)))
    return MapCrop(array.astype(np.uint8), crop.box, crop.iso)
