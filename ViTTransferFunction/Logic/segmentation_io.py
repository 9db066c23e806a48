"""Segmentations to files that Slicer opens: `.seg.nrrd` with names and colours, or a plain label map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813
from scipy import ndimage

from .annotations import Color, default_color
from .atomic_file import replacing
from .errors import InputError
from .geometry import LPS_TO_RAS, Geometry
from .volume_io import read_label_map

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
    with replacing(path) as temporary:
        if path.name.lower().endswith(".seg.nrrd"):
            _write_slicer_segmentation(temporary, labels, geometry, segments)
        else:
            write_image(temporary, labels, geometry)


def read_segmentation(path: Path) -> tuple[np.ndarray, Geometry, list[Segment]]:
    """Read what `write_segmentation` writes, or any Slicer segmentation whose segments share one layer.

    Returns:
        Labels (K, J, I), 1 + index for each segment; their geometry; the segments. A plain label map's segments are named by
        their numbers.

    Raises:
        InputError: missing, unreadable, or the segments overlap.
    """
    if not path.is_file():
        raise InputError(f"There is no segmentation file {path}.")
    if path.name.lower().endswith(".seg.nrrd"):
        return _read_slicer_segmentation(path)
    labels, geometry = read_label_map(path)
    values = [int(value) for value in np.unique(labels) if value]
    segments = [Segment(str(value), default_color(index)) for index, value in enumerate(values)]
    return _relabelled(labels, values), geometry, segments


def resample_labels(labels: np.ndarray, geometry: Geometry, target: Geometry) -> np.ndarray:
    """Labels on another grid, nearest neighbour, 0 outside; Slicer stores only the box that segments fill.

    Args:
        labels: (K, J, I) on `geometry`.
        target: the grid to bring them to.

    Returns:
        (K, J, I) of `target`, the dtype of `labels`.
    """
    source_of_target = np.linalg.inv(geometry.ijk_to_ras) @ target.ijk_to_ras
    matrix, offset = source_of_target[2::-1, 2::-1], source_of_target[2::-1, 3]
    return ndimage.affine_transform(
        labels, matrix, offset, output_shape=target.shape, order=0, mode="constant", prefilter=False
    )


def write_image(path: Path, array: np.ndarray, geometry: Geometry) -> None:
    """Write an array (K, J, I) as a compressed image of any format that SimpleITK knows by its ending.

    Raises:
        InputError: the file cannot be written.
    """
    image = sitk.GetImageFromArray(array)
    ijk_to_lps = LPS_TO_RAS @ geometry.ijk_to_ras
    image.SetOrigin(ijk_to_lps[:3, 3].tolist())
    image.SetSpacing(geometry.spacing_mm.tolist())
    image.SetDirection((ijk_to_lps[:3, :3] / geometry.spacing_mm).ravel().tolist())
    try:
        sitk.WriteImage(image, str(path), useCompression=True)
    except RuntimeError as error:
        raise InputError(f"Cannot write {path}: {str(error).strip().splitlines()[-1].strip()}") from error


def _write_slicer_segmentation(path: Path, labels: np.ndarray, geometry: Geometry, segments: Sequence[Segment]) -> None:
    import slicerio

    slicerio.write_segmentation(
        str(path),
        {
            "voxels": labels.transpose(2, 1, 0),
            "ijkToLPS": LPS_TO_RAS @ geometry.ijk_to_ras,
            "containedRepresentationNames": ["Binary labelmap"],
            "segments": [
                {"id": f"Segment_{label}", "name": segment.name, "color": list(segment.color), "labelValue": label, "layer": 0}
                for label, segment in enumerate(segments, start=1)
            ],
        },
        compression_level=4,
    )


def _read_slicer_segmentation(path: Path) -> tuple[np.ndarray, Geometry, list[Segment]]:
    import nrrd
    import slicerio

    try:
        content = slicerio.read_segmentation(str(path))
    except (nrrd.NRRDError, OSError, KeyError, ValueError) as error:
        raise InputError(f"{path} cannot be read as a Slicer segmentation: {error}") from error
    voxels = content["voxels"]
    if voxels.ndim != 3:
        raise InputError(f"The segments of {path} overlap; expected one label for each voxel. Export them apart.")
    labels = np.ascontiguousarray(voxels.transpose(2, 1, 0))
    segments = [Segment(entry["name"], tuple(float(c) for c in entry["color"])) for entry in content["segments"]]
    geometry = Geometry(labels.shape, LPS_TO_RAS @ np.array(content["ijkToLPS"]))
    return _relabelled(labels, [int(entry["labelValue"]) for entry in content["segments"]]), geometry, segments


def _relabelled(labels: np.ndarray, values: list[int]) -> np.ndarray:
    """Labels in which the index-th of `values` has become 1 + index, and all else 0."""
    relabelled = np.zeros(labels.shape, dtype=np.uint16)
    for index, value in enumerate(values):
        relabelled[labels == value] = index + 1
    return relabelled
