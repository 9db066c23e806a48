"""The part of a full-resolution map that matters: the box around its iso-surface, in bytes.

A structure fills a small part of a volume. Its box, at one byte a voxel, is hundreds of times smaller than the map, and small
enough to be handed from process to process and shown at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.classes.class_map import FULL_SCALE, NEAR_SHARE_OF_ISO, ClassMap
from ..core.classes.class_request import ClassRequest
from ..core.volumes.bounding_box import bounding_box, grown, out_of, whole_box
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
        self._crops.append(crop_map(full.voxels, full.iso))

    def of(self, labels: np.ndarray) -> tuple[MapCrop, ...]:
        """The crops of all classes, given the `labels` (K, J, I) of the volume that came of their maps; to be asked once."""
        # Those of the maps leave memory one by one.
        crops = (self._crops.pop(0) for _ in range(len(self._crops)))
        return tuple(restricted(crop, labels, label) for label, crop in enumerate(crops, start=1))


def crop_map(voxels: VoxelMap, iso: float) -> MapCrop:
    """Cut a map down to the box of what reaches half of its iso value (`NEAR_SHARE_OF_ISO`) and two voxels around."""
    near = NEAR_SHARE_OF_ISO * iso
    reaching = voxels.box_above(near) or (slice(0, 0),) * 3
    around = k, j, i = grown(reaching, (MARGIN_VOXELS,) * 3, whole_box(voxels.shape))
    array = np.empty([extent.stop - extent.start for extent in around], dtype=np.uint8)
    reaches = np.empty(array.shape, dtype=bool)
    # Plane by plane: in four bytes a voxel, twice, a long structure's box would be more than the volume.
    for index, of_plane, reaches_there in zip(range(k.start, k.stop), array, reaches, strict=True):
        (similarities,) = voxels.part((slice(index, index + 1), j, i))
        of_plane[...] = np.rint(similarities * np.float32(FULL_SCALE))
        np.greater_equal(similarities, near, out=reaches_there)
    # Where nothing reaches it, a box all the same: two voxels, so that it has an extent.
    box = bounding_box(reaches, MARGIN_VOXELS) or (slice(0, 2),) * 3
    return MapCrop(array[box].copy(), out_of(box, around), iso)


def restricted(crop: MapCrop, labels: np.ndarray, label: int) -> MapCrop:
    """The crop whose iso-surface encloses nothing but the voxels that carry `label` in `labels` (K, J, I) of the volume.

    Other classes may have won the rest, or it was dropped as a part without a click.
    """
    # Every byte reaches a threshold of 0.
    iso = crop.iso or 1.0 / FULL_SCALE
    threshold = int(np.ceil(iso * FULL_SCALE))
    array = np.empty_like(crop.array)
    # Plane by plane, since a long structure's box is large: at once, it would take as much as five of it.
    for restricted_plane, plane, of_plane in zip(array, crop.array, labels[crop.box], strict=True):
        inside = of_plane == label
        restricted_plane[...] = np.where(inside, np.maximum(plane, threshold), np.minimum(plane, threshold - 1))
    return MapCrop(array, crop.box, iso)
