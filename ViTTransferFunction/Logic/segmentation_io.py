"""Segmentations to files that Slicer opens: `.seg.nrrd` with names and colours, or a plain label map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813
from scipy import ndimage

from .annotations import Color, default_color
from .atomic_file import replacing
from .errors import InputError
from .geometry import LPS_TO_RAS, Geometry
from .volume_io import image_geometry, last_line, read_image

LABEL_MAP_ENDINGS = (".nii.gz", ".nii", ".nrrd", ".mha")


@dataclass(frozen=True)
class Segment:
    """One segment: its name and its colour in [0, 1]."""

    name: str
    color: Color


def check_segmentation_path(path: Path) -> None:
    """Raise InputError unless the file's ending says a format that `write_segmentation` writes."""
    if not path.name.lower().endswith((".seg.nrrd", *LABEL_MAP_ENDINGS)):
        known = ", ".join(LABEL_MAP_ENDINGS)
        raise InputError(f"{path} has no known ending; expected .seg.nrrd (a Slicer segmentation) or a label map: {known}.")


def write_segmentation(path: Path, labels: np.ndarray, geometry: Geometry, segments: Sequence[Segment]) -> None:
    """Write a label map with its segments' names and colours, whole or not at all.

    Args:
        path: ending in `.seg.nrrd`, or in a label map format, which keeps numbers only.
        labels: (K, J, I), 0 for background, 1 + index for each segment.
        geometry: of the labels.
        segments: in the order of their labels.

    Raises:
        InputError: unknown ending, or the file cannot be written.
    """
    check_segmentation_path(path)
    labels = labels.astype(np.uint8 if len(segments) < 256 else np.uint16)
    tags = _segment_tags(labels.shape, segments) if _is_slicer_segmentation(path) else {}
    with replacing(path) as temporary:
        write_image(temporary, labels, geometry, tags)


def read_segmentation(path: Path) -> tuple[np.ndarray, Geometry, list[Segment]]:
    """Read what `write_segmentation` writes, or any Slicer segmentation whose segments share one layer.

    Returns:
        Labels (K, J, I), 1 + index for each segment; their geometry; the segments. A plain label map's segments are named by
        their numbers.

    Raises:
        InputError: missing, unreadable, or the segments overlap (Slicer then stores several layers).
    """
    image = read_image(path)
    labels, geometry = sitk.GetArrayFromImage(image), image_geometry(image)
    by_label = _segments_from_tags(image, path) if _is_slicer_segmentation(path) else _numbered_segments(labels)
    relabelled = np.zeros(labels.shape, dtype=np.uint16)
    for index, label in enumerate(by_label):
        relabelled[labels == label] = index + 1
    return relabelled, geometry, list(by_label.values())


def resample_labels(labels: np.ndarray, geometry: Geometry, target: Geometry) -> np.ndarray:
    """Labels on another grid, nearest neighbour, 0 outside; Slicer stores only the box that segments fill.

    Args:
        labels: (K, J, I) on `geometry`.
        target: the grid to bring them to.

    Returns:
        (K, J, I) of `target`, the dtype of `labels`.
    """
    # Rounded, so that grids which coincide but for rounding errors lose no border voxel.
    source_of_target = np.round(np.linalg.inv(geometry.ijk_to_ras) @ target.ijk_to_ras, 6)
    matrix, offset = source_of_target[2::-1, 2::-1], source_of_target[2::-1, 3]
    return ndimage.affine_transform(
        labels, matrix, offset, output_shape=target.shape, order=0, mode="constant", prefilter=False
    )


def write_image(path: Path, array: np.ndarray, geometry: Geometry, tags: Mapping[str, str] | None = None) -> None:
    """Write an array (K, J, I) as a compressed image of any format that SimpleITK knows by its ending.

    Args:
        path: where to.
        array: voxels.
        geometry: of the voxels.
        tags: key-value pairs for the header, in formats that have such.

    Raises:
        InputError: the file cannot be written.
    """
    image = sitk.GetImageFromArray(array)
    ijk_to_lps = LPS_TO_RAS @ geometry.ijk_to_ras
    image.SetOrigin(ijk_to_lps[:3, 3].tolist())
    image.SetSpacing(geometry.spacing_mm.tolist())
    image.SetDirection((ijk_to_lps[:3, :3] / geometry.spacing_mm).ravel().tolist())
    for key, value in (tags or {}).items():
        image.SetMetaData(key, value)
    try:
        sitk.WriteImage(image, str(path), useCompression=True)
    except RuntimeError as error:
        raise InputError(f"Cannot write {path}: {last_line(error)}") from error


def _is_slicer_segmentation(path: Path) -> bool:
    return path.name.lower().endswith(".seg.nrrd")


def _segment_tags(shape: tuple[int, ...], segments: Sequence[Segment]) -> dict[str, str]:
    """The header by which Slicer knows a label map as a segmentation.

    Written by SimpleITK and not by the package slicerio, whose writer takes ASCII names only.
    """
    tags = {
        "Segmentation_ContainedRepresentationNames": "Binary labelmap|",
        "Segmentation_MasterRepresentation": "Binary labelmap",
        "Segmentation_ReferenceImageExtentOffset": "0 0 0",
    }
    extent = " ".join(f"0 {count - 1}" for count in reversed(shape))
    for index, segment in enumerate(segments):
        tags |= {
            f"Segment{index}_ID": f"Segment_{index + 1}",
            f"Segment{index}_Name": segment.name,
            f"Segment{index}_NameAutoGenerated": "0",
            f"Segment{index}_Color": " ".join(f"{component:.6f}" for component in segment.color),
            f"Segment{index}_ColorAutoGenerated": "0",
            f"Segment{index}_LabelValue": str(index + 1),
            f"Segment{index}_Layer": "0",
            f"Segment{index}_Extent": extent,
            f"Segment{index}_Tags": "|",
        }
    return tags


def _segments_from_tags(image: sitk.Image, path: Path) -> dict[int, Segment]:
    """Segments by label, in the file's order."""
    tags = {key: image.GetMetaData(key) for key in image.GetMetaDataKeys()}
    segments = {}
    index = 0
    while f"Segment{index}_ID" in tags:
        try:
            red, green, blue = (float(component) for component in tags[f"Segment{index}_Color"].split())
            label = int(tags[f"Segment{index}_LabelValue"])
        except (KeyError, ValueError) as error:
            raise InputError(f"{path} is not a complete Slicer segmentation: segment {index} has no usable {error}.") from error
        segments[label] = Segment(tags.get(f"Segment{index}_Name", str(label)), (red, green, blue))
        index += 1
    if not segments:
        raise InputError(f"{path} names no segments; expected a segmentation saved by Slicer or by this program.")
    return segments


def _numbered_segments(labels: np.ndarray) -> dict[int, Segment]:
    values = [int(value) for value in np.unique(labels) if value]
    return {value: Segment(str(value), default_color(index)) for index, value in enumerate(values)}
