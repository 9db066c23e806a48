"""Prepares the voxels of segments, in short steps, in images that are not part of the scene yet."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import slicer

from ...core.volumes.geometry import Box, Geometry
from ...core.volumes.resampling import resample_labels
from ...core.volumes.stepped_work import STEP_VOXELS, Steps, slabs
from ...core.volumes.voxel_digest import VoxelDigest, voxel_digests
from ..mrml.transforms import matrix_to_world
from ..volumes.volume_nodes import geometry_from_node
from .corrections import Corrections, corrected_segments
from .labelmaps import LABELMAP, Labelmap, labelmaps_of, new_image, without_labels
from .segment_tags import CLASS_TAG, CORRECTED_TAG, read_tag, segments_of_classes

FILL_VOXELS = STEP_VOXELS // 8
"""Voxels of a step that looks for obstacles, which is slow if these are on a grid with other axes."""


@dataclass(frozen=True, eq=False)
class ClassLabels:
    """The results of several classes, which do not overlap.

    Attributes:
        array: labels in a box of the segmented volume, (K, J, I) uint8 or uint16: 1 + index of the class, 0 elsewhere. The box
            may be empty.
        first: indices (k, j, i) of the box's first voxel in the volume.
        class_ids: the id of each class, which does not depend on its name; None for a class that was removed meanwhile, whose
            voxels are left out.
    """

    array: np.ndarray
    first: tuple[int, int, int]
    class_ids: tuple[str | None, ...]

    @property
    def label_of_class(self) -> dict[str, int]:
        """The label of each class that still exists, by its id."""
        return {class_id: label for label, class_id in enumerate(self.class_ids, start=1) if class_id is not None}

    @property
    def box(self) -> Box:
        """The box of the labels in the volume."""
        k, j, i = (slice(start, start + size) for start, size in zip(self.first, self.array.shape, strict=True))
        return k, j, i


@dataclass(frozen=True, eq=False)
class PreparedSegments:
    """Everything that is needed to write segments at once.

    Attributes:
        image: image of a labelmap with the voxels of all classes.
        labels: label of each class, in order, by class id.
        digests: digest of the voxels of each label.
        ids: IDs of existing segments to be replaced, by class id.
        kept: IDs of corrected segments that are not changed, by class id.
        removed: IDs of segments to be removed, whose classes are gone.
        freed: new labelmaps for other segments, by segment ID, without the segments to be replaced or removed that share their
            present labelmap.
        mostly_taken: ids of classes with more than half of their voxels in other segments.
    """

    image: Any
    labels: dict[str, int]
    digests: dict[int, VoxelDigest]
    ids: dict[str, str]
    kept: dict[str, str]
    removed: list[str]
    freed: dict[str, Any]
    mostly_taken: list[str]

    @property
    def empty(self) -> list[str]:
        """Ids of the classes without voxels."""
        return [class_id for class_id, label in self.labels.items() if not any(self.digests[label].shape)]


def prepare_segments(
    segmentation_node: Any | None,
    volume_node: Any,
    labels: ClassLabels,
    respect_others: bool,
    corrections: Corrections,
    continued: Mapping[str, str],
    gone: Collection[str],
) -> Steps[PreparedSegments]:
    """Prepare the segments of classes in steps, without changing anything in the scene.

    Other segments are those that are neither replaced nor removed, including corrected ones that are kept. A corrected segment
    is no obstacle to its own class, whose result would otherwise lack all of its voxels; nor is the segment that a class
    continues.

    Args:
        segmentation_node: the segmentation to write to; None: a new one, without segments and transform. See `check_writable`.
        volume_node: the segmented volume.
        labels: the results.
        respect_others: leave out voxels that belong to other segments; otherwise segments may overlap with those.
        corrections: how to treat segments that were changed by hand.
        continued: ID of the segment that a class continues, by class id.
        gone: ids of classes whose segments are to be removed; corrected ones stay, whatever `corrections` says.
    """
    grid = grid_in_segmentation(volume_node, segmentation_node)
    segmentation = segmentation_node.GetSegmentation() if segmentation_node else slicer.vtkSegmentation()
    ids = segments_of_classes(segmentation, labels.label_of_class)
    left = segments_of_classes(segmentation, gone)
    kept = yield from corrected_segments(segmentation, {**left, **ids} if corrections == "keep" else left)
    ids = {class_id: segment_id for class_id, segment_id in ids.items() if class_id not in kept}
    removed = [segment_id for class_id, segment_id in left.items() if class_id not in kept]
    ours = {*ids.values(), *removed}
    others = [segment_id for segment_id in segmentation.GetSegmentIDs() if segment_id not in ours]
    obstacles = _obstacles(segmentation, others, labels, continued, kept) if respect_others else []
    labelmap = Labelmap(new_image(grid, labels.box, labels.array.dtype), {})
    digests = dict.fromkeys(labels.label_of_class.values(), VoxelDigest.of_nothing())
    mostly_taken: list[str] = []
    if labels.array.size:
        mostly_taken = yield from _fill(labelmap.voxels, labels, grid, obstacles)
        digests = yield from voxel_digests(labelmap.voxels, labelmap.geometry, digests)
    freed = yield from _freed_labelmaps(segmentation, others, ours)
    return PreparedSegments(labelmap.image, labels.label_of_class, digests, ids, kept, removed, freed, mostly_taken)


def segmentation_state(segmentation_node: Any | None, volume_node: Any) -> tuple[Any, ...]:
    """The state of the scene that `prepare_segments` depends on; if it changes, prepared segments are out of date."""
    grid = grid_in_segmentation(volume_node, segmentation_node)
    segmentation = segmentation_node.GetSegmentation() if segmentation_node else slicer.vtkSegmentation()
    segments = ((segment_id, segmentation.GetSegment(segment_id)) for segment_id in segmentation.GetSegmentIDs())
    images = ((id_, segment, segment.GetRepresentation(LABELMAP)) for id_, segment in segments)
    return (
        grid.shape,
        grid.ijk_to_ras.tobytes(),
        *(
            (id_, image, image.GetMTime() if image else 0, segment.GetLabelValue(), read_tag(segment, CLASS_TAG))
            for id_, segment, image in images
        ),
    )


def grid_in_segmentation(volume_node: Any, segmentation_node: Any | None) -> Geometry:
    """The volume's grid in the local frame of the segmentation, as it will be when segments are written."""
    grid = geometry_from_node(volume_node)
    if segmentation_node is None or takes_transform(segmentation_node):
        return grid
    to_segmentation = np.linalg.inv(matrix_to_world(segmentation_node)) @ matrix_to_world(volume_node)
    return Geometry(grid.shape, to_segmentation @ grid.ijk_to_ras)


def takes_transform(segmentation_node: Any) -> bool:
    """Whether the segmentation will be put under the volume's transform, so that both move together."""
    return not segmentation_node.GetSegmentation().GetNumberOfSegments() and not segmentation_node.GetParentTransformNode()


@dataclass(frozen=True, eq=False)
class _Obstacle:
    """A labelmap with voxels of other segments; `taken` has their labels, by the class labels that they do not obstruct."""

    voxels: np.ndarray
    geometry: Geometry
    taken: dict[tuple[int, ...], list[int]]


def _obstacles(
    segmentation: Any, others: Collection[str], labels: ClassLabels, continued: Mapping[str, str], kept: Mapping[str, str]
) -> list[_Obstacle]:
    obstacles = []
    for labelmap in labelmaps_of(segmentation, others):
        taken: dict[tuple[int, ...], list[int]] = {}
        for segment_id, label in labelmap.labels.items():
            corrected = read_tag(segmentation.GetSegment(segment_id), CORRECTED_TAG)
            # A class and its duplicate may continue the same segment.
            own_labels = tuple(
                own_label
                for class_id, own_label in labels.label_of_class.items()
                if segment_id in (continued.get(class_id), kept.get(class_id)) or class_id == corrected
            )
            taken.setdefault(own_labels, []).append(label)
        obstacles.append(_Obstacle(labelmap.voxels, labelmap.geometry, taken))
    return obstacles


def _fill(target: np.ndarray, labels: ClassLabels, grid: Geometry, obstacles: Sequence[_Obstacle]) -> Steps[list[str]]:
    """Copy labels except where obstacles, on any grids, have voxels; returns the ids of classes that are mostly left out."""
    k, j, i = (slice(0, size) for size in labels.array.shape)
    part_of_grid = grid.part(labels.box)
    left_out = [label for label, class_id in enumerate(labels.class_ids, start=1) if class_id is None]
    wanted, left = (np.zeros(len(labels.class_ids) + 1, dtype=np.int64) for _ in range(2))
    for slab in slabs((k, j, i), FILL_VOXELS):
        part = target[slab]
        np.copyto(part, labels.array[slab])
        part[np.isin(part, left_out)] = 0
        if obstacles and part.any():
            wanted += np.bincount(part.ravel(), minlength=wanted.size)
            for obstacle in obstacles:
                there = resample_labels(obstacle.voxels, obstacle.geometry, part_of_grid.part(slab))
                for own_labels, taken in obstacle.taken.items():
                    in_the_way = np.isin(there, taken)
                    if own_labels:
                        in_the_way &= ~np.isin(part, own_labels)
                    part[in_the_way] = 0
            left += np.bincount(part.ravel(), minlength=left.size)
        yield part.size
    return [class_id for class_id, label in labels.label_of_class.items() if 2 * left[label] < wanted[label]]


def _freed_labelmaps(segmentation: Any, others: Collection[str], ours: Collection[str]) -> Steps[dict[str, Any]]:
    """The shared labelmaps of other segments without the segments `ours`, by ID of the other segment."""
    freed: dict[str, Any] = {}
    for labelmap in labelmaps_of(segmentation, segmentation.GetSegmentIDs()):
        sharing = [segment_id for segment_id in labelmap.labels if segment_id in others]
        left = [label for segment_id, label in labelmap.labels.items() if segment_id in ours]
        if sharing and left:
            image = yield from without_labels(labelmap, left)
            freed.update(dict.fromkeys(sharing, image))
    return freed
