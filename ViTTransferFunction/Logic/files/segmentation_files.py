"""Segmentations to files that Slicer opens: `.seg.nrrd` with names and colours, or a plain label map."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.classes.colors import Color, default_color
from ..core.system.atomic_file import replacing
from ..core.system.errors import InputError, shown
from ..core.volumes.geometry import LPS_TO_RAS, Geometry
from ..core.volumes.label_dtype import label_dtype
from .image_formats import DICOM_READER, SEGMENTATION_ENDING, image_format, locate_voxels
from .itk_errors import last_line
from .label_map_check import MOST_LABELS, looks_like_labels
from .volume_files import read_geometry, read_image

LABEL_MAP_ENDINGS = (".nii.gz", ".nii", ".nrrd", ".mha")

MOST_SEGMENTS = 1000
"""A file with more different numbers than this is a volume that was named by mistake."""

FEW_LABELS = 32
"""With more different numbers than this, it is checked whether a file is a scan of eight bits and no label map."""

LEAST_LABEL = -1
"""Lower numbers are intensities, for example of a CT; some programs mark voxels that they leave out by this one."""

LARGEST_SHIFT_VOXELS = 0.01
"""How far a written voxel may lie from its place: more than rounding to single precision, less than can be seen."""

_PROBE_BYTES = 1 << 20


@dataclass(frozen=True)
class Segment:
    """One segment: its name and its colour in [0, 1]."""

    name: str
    color: Color


def check_segmentation_path(path: Path) -> None:
    """Raise InputError unless the file's ending is of a format that `write_segmentation` writes."""
    if not path.name.lower().endswith((SEGMENTATION_ENDING, *LABEL_MAP_ENDINGS)):
        known = ", ".join(LABEL_MAP_ENDINGS)
        raise InputError(f"{path} has no known ending; expected .seg.nrrd (a Slicer segmentation) or a label map: {known}.")


def is_slicer_segmentation(path: Path) -> bool:
    """Whether a file of this name is a Slicer segmentation, which also stores names and colours."""
    return path.name.lower().endswith(SEGMENTATION_ENDING)


def write_segmentation(path: Path, labels: np.ndarray, geometry: Geometry, segments: Sequence[Segment]) -> None:
    """Write a label map with its segments' names and colours, completely or not at all.

    Args:
        path: path that ends in `.seg.nrrd` or in `LABEL_MAP_ENDINGS`; label maps store numbers only.
        labels: (K, J, I), 0 for background, 1 + index for each segment.
        geometry: geometry of the labels.
        segments: the segments, in the order of their labels.

    Raises:
        InputError: unknown ending, or the file cannot be written.
    """
    check_segmentation_path(path)
    labels = labels.astype(label_dtype(len(segments)), copy=False)
    write_image(path, labels, geometry, _segment_tags(labels.shape, segments) if is_slicer_segmentation(path) else {})


def read_segmentation(path: Path) -> tuple[np.ndarray, Geometry, list[Segment]]:
    """Read what `write_segmentation` writes, or any Slicer segmentation whose segments share one layer.

    Returns:
        Labels (K, J, I), 1 + index for each segment; their geometry; the segments. A plain label map's segments are named by
        their numbers.

    Raises:
        InputError: the file is missing, unreadable, truncated, DICOM or not of whole numbers, its segments overlap (Slicer then
            stores several layers), or two segments have the same label.
    """
    _check_is_no_dicom(path)
    labels, geometry, tags = read_image(path)
    _check_whole_numbers(labels, path)
    by_label = _segments_from_tags(tags, path) if is_slicer_segmentation(path) else _numbered_segments(labels, path)
    relabelled = np.zeros(labels.shape, dtype=label_dtype(len(by_label)))
    for index, label in enumerate(by_label):
        relabelled[labels == label] = index + 1
    return relabelled, geometry, list(by_label.values())


def _check_is_no_dicom(path: Path) -> None:
    """Refuse DICOM segmentations: ITK would stack the frames of all segments, and make a single segment of them."""
    if image_format(path).reader == DICOM_READER:
        raise InputError(
            f"{path} is a DICOM file; expected a Slicer segmentation ({SEGMENTATION_ENDING}) or a label map: "
            f"{', '.join(LABEL_MAP_ENDINGS)}. Open it in 3D Slicer, and save the segmentation as {SEGMENTATION_ENDING}."
        )


def write_image(path: Path, array: np.ndarray, geometry: Geometry, tags: Mapping[str, str] | None = None) -> None:
    """Write an array (K, J, I) as a compressed image, completely or not at all.

    The file is read back and compared, because ITK does not notice a full disk: the header by ITK, voxels by `StoredVoxels`.

    Args:
        path: path of the file; its ending, one of `LABEL_MAP_ENDINGS`, gives the format.
        array: voxels.
        geometry: geometry of the voxels.
        tags: key-value pairs for the header, in formats that have them.

    Raises:
        InputError: the file cannot be written, or the format cannot hold these voxels in their place.
    """
    with replacing(path) as temporary:
        try:
            _write_by_itk(temporary, array, geometry, tags or {})
        except RuntimeError as error:
            _raise_if_full(temporary)
            raise InputError(f"Cannot write {path}: {last_line(error).replace(str(temporary), str(path))}") from error
        if not _is_as_written(temporary, array):
            _raise_if_full(temporary)
            raise InputError(f"Cannot write {path}: the disk does not give back what was written to it. Choose another folder.")
        if not _lies_in_its_place(temporary, geometry):
            raise InputError(f"Cannot write {path}: its format cannot hold where the volume lies. Write .nrrd or .seg.nrrd.")


def _write_by_itk(path: Path, array: np.ndarray, geometry: Geometry, tags: Mapping[str, str]) -> None:
    image = sitk.GetImageFromArray(array)
    ijk_to_lps = LPS_TO_RAS @ geometry.ijk_to_ras
    image.SetOrigin(ijk_to_lps[:3, 3].tolist())
    image.SetSpacing(geometry.spacing_mm.tolist())
    image.SetDirection((ijk_to_lps[:3, :3] / geometry.spacing_mm).ravel().tolist())
    for key, value in tags.items():
        image.SetMetaData(key, value)
    sitk.WriteImage(image, str(path), useCompression=True)


def _is_as_written(path: Path, array: np.ndarray) -> bool:
    try:
        stored = locate_voxels(path)
        return stored is not None and stored.hold(array)
    except InputError:
        return False


def _raise_if_full(temporary: Path) -> None:
    """Raise the OSError that explains why a file is not complete, if writing some more to it gives one."""
    with temporary.open("ab") as file:
        file.write(bytes(_PROBE_BYTES))
        file.flush()
        os.fsync(file.fileno())


def _lies_in_its_place(path: Path, meant: Geometry) -> bool:
    """Whether a written file has the geometry `meant`; NIfTI, for example, cannot hold axes that are not at right angles."""
    try:
        stored = read_geometry(path)
    except InputError:
        return False
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * (np.array(meant.shape[::-1]) - 1)
    off_mm = np.abs(stored.ijk_to_ras_points(corners) - meant.ijk_to_ras_points(corners)).max()
    return stored.shape == meant.shape and bool(off_mm <= LARGEST_SHIFT_VOXELS * meant.spacing_mm.min())


def _segment_tags(shape: tuple[int, ...], segments: Sequence[Segment]) -> dict[str, str]:
    """Header fields by which Slicer recognises a label map as a segmentation.

    SimpleITK writes them, and not the package slicerio, whose writer accepts ASCII names only.
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


def _check_whole_numbers(labels: np.ndarray, path: Path) -> None:
    if np.issubdtype(labels.dtype, np.floating) and not (np.isfinite(labels).all() and (labels == np.rint(labels)).all()):
        raise InputError(f"{path} is no label map: it holds values that are no whole numbers. Name a segmentation.")


def _segments_from_tags(tags: Mapping[str, str], path: Path) -> dict[int, Segment]:
    """Segments by label, in the file's order. Missing fields have Slicer's defaults, but missing colours are not all grey."""
    segments: dict[int, Segment] = {}
    index = 0
    while (id_ := tags.get(f"Segment{index}_ID")) is not None:
        name = _in_utf8(tags.get(f"Segment{index}_Name", id_))
        try:
            color = _color_from_tag(tags[f"Segment{index}_Color"]) if f"Segment{index}_Color" in tags else default_color(index)
            label = _label_from_tag(tags.get(f"Segment{index}_LabelValue", "1"))
        except ValueError as error:
            raise InputError(
                f"{path} is damaged: the segment {shown(name)} has {error}. Open it in Slicer and save it again."
            ) from error
        if label in segments:
            raise InputError(
                f"{path} has two segments of the same voxels, {shown(segments[label].name)} and {shown(name)}, both labelled "
                f"{label}; expected a label for each. Remove one of them in Slicer, and save it again."
            )
        segments[label] = Segment(name, color)
        index += 1
    if not segments:
        raise InputError(f"{path} names no segments; expected a segmentation saved by Slicer or by this program.")
    return segments


def _in_utf8(text: str) -> str:
    """A text of a header; if it is not UTF-8, as from older Slicers on Windows, it is read as Latin-1."""
    written = text.encode("utf-8", "surrogateescape")
    try:
        return written.decode()
    except UnicodeDecodeError:
        return written.decode("latin-1")


def _color_from_tag(text: str) -> Color:
    try:
        red, green, blue = (float(component) for component in text.split())
    except ValueError:
        red = green = blue = -1.0
    if not all(0.0 <= component <= 1.0 for component in (red, green, blue)):
        raise ValueError(f"the color {shown(text)}; expected three numbers from 0 to 1")
    return red, green, blue


def _label_from_tag(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"the label {shown(text)}; expected a whole number") from None


def _numbered_segments(labels: np.ndarray, path: Path) -> dict[int, Segment]:
    values = [int(value) for value in np.unique(labels) if value]
    if len(values) > MOST_SEGMENTS:
        raise InputError(f"{path} is no label map: it holds {len(values)} different numbers. Name a segmentation.")
    if values and values[0] < LEAST_LABEL:
        raise InputError(f"{path} is no label map: it holds numbers below zero, down to {values[0]}. Name a segmentation.")
    # Needed because a scan of eight bits has no more numbers than a segmentation may have.
    if FEW_LABELS < len(values) <= MOST_LABELS and not looks_like_labels(labels):
        raise InputError(f"{path} is no label map: its {len(values)} numbers are strewn, as in a scan. Name a segmentation.")
    return {value: Segment(str(value), default_color(index)) for index, value in enumerate(values)}
