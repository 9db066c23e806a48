"""Digests of sets of voxels, to recognise a set that has not changed, however it is stored.

A segment's voxels may be stored in a larger or smaller image, together with other labels, under another label, or in a file.
The digest depends only on what is the same in all of these: the voxels within their bounding box, and the position of that box.
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
"""Tolerance for corners: more than the rounding of matrices written as text, less than any actual shift."""

LARGEST_USUAL_LABEL = np.iinfo(np.uint16).max
"""The largest label that this program writes, and most others do."""


@dataclass(frozen=True, eq=False)
class VoxelDigest:
    """The digest of a set of voxels.

    Attributes:
        shape: of their bounding box, (K, J, I); zeros if there are no voxels.
        hash: hash of the voxels within the box.
        corners_ras: corners of the box, (4, 3) RAS millimetres: the first, and those at the ends of its edges along I, J and K.
    """

    shape: tuple[int, int, int]
    hash: str
    corners_ras: np.ndarray

    def is_like(self, other: VoxelDigest | None) -> bool:
        """Whether both are digests of the same voxels at the same position; False if `other` is None."""
        if other is None or self.shape != other.shape or self.hash != other.hash:
            return False
        edges_mm = np.linalg.norm(self.corners_ras[1:] - self.corners_ras[0], axis=1)
        smallest_mm = min((edge / count for edge, count in zip(edges_mm, self.shape[::-1], strict=True) if count), default=0.0)
        return bool(np.abs(self.corners_ras - other.corners_ras).max() <= TOLERANCE_VOXELS * smallest_mm)

    @classmethod
    def of_nothing(cls) -> VoxelDigest:
        """The digest of an empty set."""
        return cls((0, 0, 0), "", np.zeros((4, 3)))

    def to_text(self) -> str:
        """The digest as text, for `from_text`."""
        return json.dumps([self.shape, self.hash, self.corners_ras.tolist()])

    @classmethod
    def from_text(cls, text: str) -> VoxelDigest | None:
        """The digest from a text of `to_text`; None if the text is invalid, since scenes may contain anything."""
        try:
            shape, hash_, corners = json.loads(text)
            k, j, i = (int(size) for size in shape)
            return cls((k, j, i), str(hash_), np.array(corners, dtype=np.float64).reshape(4, 3))
        except (TypeError, ValueError, OverflowError, RecursionError):
            return None


def voxel_digests(labels: np.ndarray, geometry: Geometry, values: Collection[int]) -> Steps[dict[int, VoxelDigest]]:
    """Digests of the voxels of several labels; in steps.

    Args:
        labels: (K, J, I), whole numbers of any dtype, floating point included.
        geometry: of the labels.
        values: labels, at least 1; labels without voxels get the digest of an empty set.

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
    """The bounding box of each label in a label map (K, J, I), by label; in steps."""
    boxes: dict[int, Box] = {}
    for slab in slabs(_all(labels)):
        part = labels[slab]
        for value, found in _found_in(part):
            box = out_of(found, slab)
            boxes[value] = common_box([boxes[value], box]) if value in boxes else box
        yield part.size
    return boxes


def _found_in(labels: np.ndarray) -> Iterator[tuple[int, Box]]:
    """Yield the labels in an array and their bounding boxes.

    Segments written by scripts may be floating point, and atlases have labels of nine digits; SciPy needs memory for all
    numbers up to the largest label. Such labels are therefore numbered anew.
    """
    if labels.dtype.kind in "iu" and labels.max(initial=0) <= LARGEST_USUAL_LABEL:
        names, numbers = None, labels
    else:
        names, numbers = np.unique(labels, return_inverse=True)
        numbers = numbers.reshape(labels.shape) + 1
    for number, found in enumerate(ndimage.find_objects(numbers), start=1):
        value = number if names is None else names[number - 1].item()
        # Fractions and NaN are not labels.
        if found is not None and value >= 1 and value % 1 == 0:
            yield int(value), found


def _digest(labels: np.ndarray, geometry: Geometry, value: int, box: Box) -> Steps[VoxelDigest]:
    digest = hashlib.blake2b(digest_size=16)
    for slab in slabs(box):
        # Each row is packed separately, so that the digest does not depend on the slabs.
        digest.update(np.packbits(labels[slab] == value, axis=-1).tobytes())
        yield 0
    part = geometry.part(box)
    corners = part.ijk_to_ras_points(np.vstack([np.zeros((1, 3)), np.diag(part.shape[::-1])]) - 0.5)
    return VoxelDigest(part.shape, digest.hexdigest(), corners)


def _all(array: np.ndarray) -> Box:
    k, j, i = (slice(0, size) for size in array.shape)
    return k, j, i
