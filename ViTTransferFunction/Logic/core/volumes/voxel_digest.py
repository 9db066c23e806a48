"""Whether a set of voxels is still the same, wherever it is stored.

A segment's voxels may be kept in a larger or smaller image, beside other labels, under another label, or be read from a file.
The digest is of what stays the same then: the voxels in the smallest box that holds them, and where that box lies.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .bounding_box import common_box, out_of
from .geometry import Box, Geometry
from .stepped_work import Steps, slabs

TOLERANCE_VOXELS = 0.01
"""How far a corner may lie from where it was: more than matrices lose when a file holds them as text, less than any shift."""

LARGEST_USUAL_LABEL = np.iinfo(np.uint16).max
"""Of ours, and of most others."""


@dataclass(frozen=True, eq=False)
class VoxelDigest:
    """Of a set of voxels.

    Attributes:
        shape: of the smallest box that holds them, (K, J, I); zeros where there are none.
        hash: of the voxels in that box.
        corners_ras: of that box, (4, 3) millimetres: the first one, and those at the other ends of its edges along I, J and K.
    """

    shape: tuple[int, int, int]
    hash: str
    corners_ras: np.ndarray

    def is_like(self, other: VoxelDigest | None) -> bool:
        """Whether both are of the same voxels at the same place; nothing is like None."""
        if other is None or self.shape != other.shape or self.hash != other.hash:
            return False
        edges_mm = np.linalg.norm(self.corners_ras[1:] - self.corners_ras[0], axis=1)
        smallest_mm = min((edge / count for edge, count in zip(edges_mm, self.shape[::-1], strict=True) if count), default=0.0)
        return bool(np.abs(self.corners_ras - other.corners_ras).max() <= TOLERANCE_VOXELS * smallest_mm)

    @classmethod
    def of_nothing(cls) -> VoxelDigest:
        """Of no voxel at all."""
        return cls((0, 0, 0), "", np.zeros((4, 3)))

    def to_text(self) -> str:
        """As text, from which `from_text` makes it again."""
        return json.dumps([self.shape, self.hash, self.corners_ras.tolist()])

    @classmethod
    def from_text(cls, text: str) -> VoxelDigest | None:
        """The digest that a text stands for; None where it is no such text: a scene may come from anywhere."""
        try:
            shape, hash_, corners = json.loads(text)
            k, j, i = (int(size) for size in shape)
            return cls((k, j, i), str(hash_), np.array(corners, dtype=np.float64).reshape(4, 3))
        except (TypeError, ValueError, OverflowError, RecursionError):
            return None


def voxel_digests(labels: np.ndarray, geometry: Geometry, values: Collection[int]) -> Steps[dict[int, VoxelDigest]]:
    """Digest the voxels of each of several labels.

    Args:
        labels: (K, J, I), whole numbers of any type.
        geometry: of the labels.
        values: labels, from 1 up; those that no voxel has get the digest of nothing.

    Returns:
        The digests, by label.
    """
    boxes = yield from label_boxes(labels)
    digests: dict[int, VoxelDigest] = {}
    for value in values:
        if value in boxes:
            digests[value] = yield from _digest(labels, geometry, value, boxes[value])
        else:
            digests[value] = VoxelDigest.of_nothing()
    return digests


def label_boxes(labels: np.ndarray) -> Steps[dict[int, Box]]:
    """The smallest box that holds each label of a label map (K, J, I), by label; in steps."""
    boxes: dict[int, Box] = {}
    for slab in slabs(_all(labels)):
        part = labels[slab]
        for value, found in _found_in(part):
            box = out_of(found, slab)
            boxes[value] = common_box([boxes[value], box]) if value in boxes else box
        yield part.size
    return boxes


def _found_in(labels: np.ndarray) -> Iterator[tuple[int, Box]]:
    """The labels in an array, and the smallest box of each.

    Segments that scripts write may be of floating point, and atlases have labels of nine digits, for each of which SciPy would
    take memory, and for those below.
    """
    if labels.dtype.kind in "iu" and labels.max(initial=0) <= LARGEST_USUAL_LABEL:
        names, numbers = None, labels
    else:
        names, numbers = np.unique(labels, return_inverse=True)
        numbers = numbers.reshape(labels.shape) + 1
    for number, found in enumerate(ndimage.find_objects(numbers), start=1):
        value = number if names is None else names[number - 1].item()
        # No label is a fraction, or no number at all.
        if found is not None and value >= 1 and value % 1 == 0:
            yield int(value), found


def _digest(labels: np.ndarray, geometry: Geometry, value: int, box: Box) -> Steps[VoxelDigest]:
    digest = hashlib.blake2b(digest_size=16)
    for slab in slabs(box):
        # Rows are packed one by one, so that it does not matter where slabs end.
        digest.update(np.packbits(labels[slab] == value, axis=-1).tobytes())
        yield 0
    part = geometry.part(box)
    corners = part.ijk_to_ras_points(np.vstack([np.zeros((1, 3)), np.diag(part.shape[::-1])]) - 0.5)
    return VoxelDigest(part.shape, digest.hexdigest(), corners)


def _all(array: np.ndarray) -> Box:
    k, j, i = (slice(0, size) for size in array.shape)
    return k, j, i
