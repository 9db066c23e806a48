"""Headers of DICOM files: position, series, and other properties of slices."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.system.errors import InputError
from .dicom_encoding import lacks_pixels, require_memory_to_unpack
from .dicom_frames import LARGEST_TURN, ORIENTATION, PIXEL_SIZE, POSITION, says_of_frames
from .dicom_kind import instead_of_scan
from .dicom_text import text_of
from .image_formats import DICOM_READER

ROUNDED_DIRECTION = 0.05
"""Tolerance between the stated components of a direction and those of the unit vector that ITK made of it."""

CUT_OFF = "is cut off: it has fewer pixels than its header promises. Copy or export it again."
"""The end of a sentence that begins with a file."""


@dataclass(frozen=True, eq=False)
class DicomSlice:
    """What the header says about a slice, or about the frames of one file.

    Attributes:
        path: of the file.
        position: centre of the first pixel, (3,), LPS millimetres.
        directions: directions of the axes, in columns (3, 3); the last one is the normal.
        size: (I, J, K); K is 1 except for files with several frames.
        pixel_mm: distances between pixel centres along I and J, (2,), millimetres; 0 if the header contains something other
            than numbers, for which ITK makes up values.
        unsaid: which of `POSITION`, `ORIENTATION` and `PIXEL_SIZE` the header lacks or states with invalid values, both where
            slices state them and where frames do. ITK assumes 0, axial, and 1 mm instead.
        kind: ITK's pixel type. It may differ between slices, since each may have its own scaling, as in PET.
        is_cut_off: whether it has fewer pixels than the header promises, in place of which ITK reads anything.
        components: numbers per pixel; more than one in colour images.
        is_inverted: whether the lowest number is white (MONOCHROME1). ITK, and therefore Slicer, inverts such intensities.
        instance_uid: (0008,0018), of which there is no other image; "" if it was removed.
        series_uid: (0020,000E); "" if it was removed.
        series_number: (0020,0011), or "".
        description: of the series, (0008,103E), or "".
        modality: (0008,0060), or "".
        date: of the series, or else of the study: YYYY-MM-DD, or "".
        instead: what the file is if not a scan (`instead_of_scan`); "" if it may be one.
        traits: values of further elements, by tag as ITK writes it ("0018|0081").
    """

    path: Path
    position: np.ndarray
    directions: np.ndarray
    size: tuple[int, int, int]
    pixel_mm: np.ndarray
    unsaid: frozenset[str]
    kind: int
    is_cut_off: bool
    components: int
    is_inverted: bool
    instance_uid: str
    series_uid: str
    series_number: str
    description: str
    modality: str
    date: str
    instead: str
    traits: Mapping[str, str]


def read_slice(path: Path, traits: Sequence[str] = ()) -> DicomSlice:
    """Read the header of a DICOM file.

    Args:
        path: of the file.
        traits: tags of the elements to read into `DicomSlice.traits`.

    Raises:
        RuntimeError: from ITK: the file is truncated, is not DICOM, or contains no image, such as reports and contours.
        InputError: the file cannot be read, or its unpacked content does not fit into memory.
    """
    require_memory_to_unpack(path)
    reader = sitk.ImageFileReader()
    reader.SetImageIO(DICOM_READER)
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    width, height, frames = reader.GetSize()[:3]
    return DicomSlice(
        path,
        np.array(reader.GetOrigin()[:3]),
        _directions(reader),
        (width, height, frames),
        _pixel_mm(reader),
        frozenset(tag for tag in _unsaid(reader) if not says_of_frames(path, tag)),
        reader.GetPixelID(),
        _is_cut_off(reader, path),
        reader.GetNumberOfComponents(),
        text_of(reader, "0028|0004") == "MONOCHROME1",
        text_of(reader, "0008|0018"),
        text_of(reader, "0020|000e"),
        text_of(reader, "0020|0011"),
        text_of(reader, "0008|103e"),
        text_of(reader, "0008|0060"),
        _date(text_of(reader, "0008|0021") or text_of(reader, "0008|0020")),
        instead_of_scan(path, reader),
        {tag: text_of(reader, tag) for tag in traits},
    )


def pixel_digest(path: Path) -> bytes:
    """SHA-256 of a slice's intensities, however they are stored; of its path where they cannot be read."""
    reader = sitk.ImageFileReader()
    reader.SetImageIO(DICOM_READER)
    reader.SetFileName(str(path))
    try:
        intensities = sitk.GetArrayFromImage(reader.Execute()).astype(np.float64)
    except RuntimeError:
        return hashlib.sha256(os.fsencode(path)).digest()
    return hashlib.sha256(intensities.tobytes()).digest()


def check_may_be_scan(path: Path, on_warning: Callable[[str], None]) -> None:
    """Check that a DICOM file may be a scan.

    Args:
        path: of the file.
        on_warning: is called with a warning if intensities are inverted (`warn_of_inversion`).

    Raises:
        InputError: it is known to be something else, cannot be read, or does not fit into memory.
    """
    try:
        found = read_slice(path)
    except RuntimeError:
        if instead := instead_of_scan(path):
            raise InputError(f"{path} is {instead}") from None
        return
    if found.instead:
        raise InputError(f"{path} is {found.instead}")
    if found.is_cut_off:
        raise InputError(f"{path} {CUT_OFF}")
    warn_of_inversion(path, [found], on_warning)


def warn_of_inversion(path: Path, slices: Sequence[DicomSlice], on_warning: Callable[[str], None]) -> None:
    """Warn if slices are inverted, since nothing in the volume shows that its intensities differ from the scanner's.

    Args:
        path: of the file or folder that contains the slices.
        slices: of one volume.
        on_warning: is called with the warning.
    """
    if any(each.is_inverted for each in slices):
        on_warning(
            f"{path} is stored with white as its lowest number (MONOCHROME1), and is read inverted, as 3D Slicer does: "
            "intensities are no Hounsfield units. Points and segments lie where they should."
        )


def heights(slices: Sequence[DicomSlice]) -> np.ndarray:
    """Positions of slices along the normal of the first, (N,), millimetres."""
    return np.array([each.position for each in slices]) @ slices[0].directions[:, 2]


def turned(slices: Sequence[DicomSlice]) -> np.ndarray:
    """Which slices are not parallel to the first, (N,) bool."""
    directions = np.array([each.directions for each in slices])
    return np.abs(directions - directions[0]).max(axis=(1, 2)) > LARGEST_TURN


def number_of(text: str) -> float | None:
    """The number in a header's text; None if the text is not a number."""
    try:
        return float(text)
    except ValueError:
        return None


def _is_cut_off(reader: sitk.ImageFileReader, path: Path) -> bool:
    # Pixels of several numbers may be stored as fewer.
    if text_of(reader, "0028|0002") != "1":
        return False
    bits = number_of(text_of(reader, "0028|0100")) or 0.0
    return lacks_pixels(path, int(math.prod(reader.GetSize()[:3]) * bits / 8.0))


def _unsaid(reader: sitk.ImageFileReader) -> Iterator[str]:
    """Tags that the header lacks in the place where single slices have them."""
    if not text_of(reader, POSITION):
        yield POSITION
    if not _says_orientation(reader):
        yield ORIENTATION
    sizes = text_of(reader, PIXEL_SIZE).split("\\")
    # Some kinds of images state it elsewhere, where ITK finds it.
    if not all(map(_is_length, sizes)) and 1.0 in reader.GetSpacing()[:2]:
        yield PIXEL_SIZE


def _says_orientation(reader: sitk.ImageFileReader) -> bool:
    """Whether ITK used the header's directions; it ignores those that are invalid or not perpendicular."""
    said = [number_of(part) for part in text_of(reader, ORIENTATION).split("\\")]
    if len(said) != 6 or None in said:
        return False
    return np.allclose(np.reshape(np.array(said, float), (2, 3)), _directions(reader).T[:2], atol=ROUNDED_DIRECTION)


def _directions(reader: sitk.ImageFileReader) -> np.ndarray:
    """Directions of the axes, in columns (3, 3)."""
    directions: np.ndarray = np.array(reader.GetDirection()).reshape(reader.GetDimension(), -1)[:3, :3]
    return directions


def _pixel_mm(reader: sitk.ImageFileReader) -> np.ndarray:
    said = text_of(reader, PIXEL_SIZE)
    down_and_across = said.split("\\")
    if len(down_and_across) == 2 and all(map(_is_length, down_and_across)):
        # Of angiographies and radiographs, ITK reads the size that a pixel has on the detector.
        return np.array(down_and_across[::-1], dtype=float)
    are_numbers = not said or all(number_of(part) is not None for part in down_and_across)
    return np.array(reader.GetSpacing()[:2]) if are_numbers else np.zeros(2)


def _is_length(text: str) -> bool:
    number = number_of(text)
    return number is not None and 0.0 < number < math.inf


def _date(written: str) -> str:
    return f"{written[:4]}-{written[4:6]}-{written[6:]}" if len(written) == 8 and written.isdigit() else ""
