"""Masks to write as segments, and what is known about segments in the scene."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import vtk

from ViTTransferFunction.Logic.compute.service import cropped_labels
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry, transform_points
from ViTTransferFunction.Logic.core.volumes.stepped_work import finished
from ViTTransferFunction.Logic.scene.mrml.transforms import matrix_to_world, numpy_matrix
from ViTTransferFunction.Logic.scene.segments.corrections import Corrections
from ViTTransferFunction.Logic.scene.segments.segment_preparation import ClassLabels, prepare_segments
from ViTTransferFunction.Logic.scene.segments.segment_writing import ClassLook, check_writable, write_prepared
from ViTTransferFunction.Logic.scene.segments.terminology import StandardCodes
from ViTTransferFunction.Testing.support.scenes import segment_points

SHAPE = (6, 7, 8)
RED = (0.9, 0.1, 0.1)
LABELMAP, SURFACE = "Binary labelmap", "Closed surface"


def block(start: int, stop: int) -> np.ndarray:
    """A mask of the slices k from `start` to `stop`, but for their borders."""
    mask = np.zeros(SHAPE, dtype=bool)
    mask[start:stop, 1:-1, 2:-1] = True
    return mask


@dataclass(frozen=True, eq=False)
class Output:
    """What is to be written for a class."""

    class_id: str
    name: str
    color: Color
    mask: np.ndarray


def output(mask: np.ndarray, class_id: str = "class-1", name: str = "growth", color: Color = RED) -> Output:
    """A mask (K, J, I) of the volume as a class's result."""
    return Output(class_id, name, color, mask)


def write_segments(
    node: Any,
    volume: Any,
    outputs: Sequence[Output],
    respect_others: bool,
    app_logic: Any = None,
    corrections: Corrections = "keep",
    continued: Mapping[str, str] | None = None,
    gone: Collection[str] = (),
) -> list[str]:
    """Write masks that do not overlap as a label map; returns the segments' IDs."""
    labels = np.zeros(outputs[0].mask.shape, dtype=np.uint16)
    for label, wanted in enumerate(outputs, start=1):
        labels[wanted.mask] = label
    cropped = cropped_labels(labels, len(outputs))
    of_classes = ClassLabels(cropped.array, cropped.first, tuple(wanted.class_id for wanted in outputs))
    check_writable(node, volume)
    prepared = finished(prepare_segments(node, volume, of_classes, respect_others, corrections, continued or {}, gone))
    looks = {wanted.class_id: ClassLook(wanted.name, wanted.color) for wanted in outputs}
    return write_prepared(prepared, node, volume, looks, StandardCodes(app_logic), source="")


def everything_about(node: Any, segment_id: str) -> dict[str, Any]:
    segment = node.GetSegmentation().GetSegment(segment_id)
    return {
        "name": segment.GetName(),
        "color": segment.GetColor(),
        "terminology": segment.GetTerminology(),
        "voxels": voxels_of(node, segment_id),
        "surface": segment.GetRepresentation(SURFACE),
    }


def voxels_of(node: Any, segment_id: str) -> list[tuple[float, ...]]:
    """Where the segment's voxels are in the scene, in RAS millimetres, sorted."""
    return rounded(segment_points(node, segment_id))


def positions_of(mask: np.ndarray, volume: Any) -> list[tuple[float, ...]]:
    """Where a mask's voxels are in the scene, by the volume's own geometry."""
    matrix = vtk.vtkMatrix4x4()
    volume.GetIJKToRASMatrix(matrix)
    return rounded(
        transform_points(
            matrix_to_world(volume), Geometry(SHAPE, numpy_matrix(matrix)).ijk_to_ras_points(np.argwhere(mask)[:, ::-1])
        )
    )


def rounded(points: np.ndarray) -> list[tuple[float, ...]]:
    # The sum makes zero of minus zero.
    return sorted(map(tuple, (np.round(points, 3) + 0.0).tolist()))
