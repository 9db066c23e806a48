"""The file formats of volumes, and what their headers say about the voxels.

Everything else in the headers is read by ITK. Some headers have to be refused before, since ITK would crash, hang, or read a
file other than the named one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..core.system.errors import InputError
from . import meta_image_header, nifti_header, nrrd_header
from .file_start import DICOM_START_BYTES, is_dicom_start, read_start
from .stored_voxels import StoredVoxels

DICOM_READER = "GDCMImageIO"
NIFTI_READER = "NiftiImageIO"

_ARCHIVE_ENDINGS = (".zip", ".7z", ".rar", ".tar", ".tar.gz", ".tgz")
"""Hospitals and public collections often provide scans in such archives."""
SEGMENTATION_ENDING = ".seg.nrrd"
"""File name ending of Slicer's segmentations."""


@dataclass(frozen=True)
class ImageFormat:
    """A format of image files.

    Attributes:
        reader: the name of ITK's reader.
        locate: finds the voxels of a file, given its first bytes; None: ITK's reader reports missing voxels by itself. Raises
            InputError if the header cannot be used.
        says_spacing: whether a header, given the file's first bytes, states the spacing of voxels along all three axes.
        says_sides: whether a file's header, given its first bytes, states the anatomical directions of its axes. Raises
            InputError if the header cannot be used.
        header: the path of the file that contains the header, given the path of a file of this format.
    """

    reader: str
    locate: Callable[[Path, bytes], StoredVoxels | None]
    says_spacing: Callable[[bytes], bool] = lambda _start: True
    says_sides: Callable[[Path, bytes], bool] = lambda _path, _start: True
    header: Callable[[Path], Path] = lambda path: path


def image_format(path: Path) -> ImageFormat:
    """The format of a file.

    DICOM is recognised by its content, since many DICOM slices are named `.img`; other formats by their ending in any case.

    Raises:
        InputError: the file cannot be read, is an archive, or is of no known format.
    """
    if is_dicom_start(read_start(path, DICOM_START_BYTES)):
        return ImageFormat(DICOM_READER, lambda _path, _start: None)
    ending = image_ending(path)
    if ending is not None:
        return _FORMATS[ending]
    check_no_archive(str(path))
    known = ", ".join(_FORMATS)
    raise InputError(f"{path} is of no known format; expected DICOM, or one of {known}. 3D Slicer can save it as one of these.")


def check_no_archive(name: str) -> None:
    """Raise InputError if a file is an archive, judging by its name; the message contains the name as given."""
    if name.lower().endswith(_ARCHIVE_ENDINGS):
        raise InputError(f"{name} is an archive. Unpack it, and open the image in it, or the folder with the DICOM files.")


def image_ending(path: Path) -> str | None:
    """The ending, in lower case, by which the file's format is known; None if there is none."""
    return next((ending for ending in _FORMATS if path.name.lower().endswith(ending)), None)


def volume_ending(path: Path) -> str | None:
    """The ending, in lower case, of a file that stands for one volume when folders are searched; None if it does not.

    Segmentations do not, and of a pair of files the one with the voxels does not.
    """
    ending = image_ending(path)
    return ending if ending in VOLUME_ENDINGS and not path.name.lower().endswith(SEGMENTATION_ENDING) else None


def locate_voxels(path: Path) -> StoredVoxels | None:
    """Where an image file's voxels are; None if ITK's reader reports missing voxels by itself.

    Raises:
        InputError: the file cannot be read, is of no known format, or its header cannot be used.
    """
    return image_format(path).locate(path, read_start(path))


def named_voxels(path: Path) -> str | None:
    """The file that a header names as the one with the voxels, as written there; None: they are in the same file.

    If the header has a list of files, only its beginning.

    Raises:
        InputError: the file cannot be read.
    """
    # Teem (NRRD) recognises files by their first bytes, MetaIO by their name.
    if read_start(path, 4) == b"NRRD":
        return nrrd_header.named_voxels(path)
    is_meta_image = path.name.lower().endswith((".mha", ".mhd"))
    return meta_image_header.named_voxels(read_start(path)) if is_meta_image else None


def says_spacing(path: Path) -> bool:
    """Whether the header of a file states the voxel spacing; if not, ITK, and therefore Slicer, assumes 1 mm.

    Raises:
        InputError: the file cannot be read, or is of no known format.
    """
    return image_format(path).says_spacing(read_start(path))


def says_sides(path: Path) -> bool:
    """Whether the header of a file states the anatomical directions of its axes.

    If not, ITK, and therefore Slicer, assumes left, posterior and superior.

    Raises:
        InputError: the file cannot be read, is of no known format, or its header cannot be used.
    """
    return image_format(path).says_sides(path, read_start(path))


_NIFTI = ImageFormat(NIFTI_READER, nifti_header.locate, says_sides=nifti_header.says_sides)
_PAIR = ImageFormat(
    NIFTI_READER,
    nifti_header.locate_of_pair,
    says_sides=nifti_header.says_sides_of_pair,
    header=nifti_header.header_of_pair,
)
_NRRD = ImageFormat("NrrdImageIO", nrrd_header.locate, nrrd_header.says_spacing, nrrd_header.says_sides)
_META_IMAGE = ImageFormat("MetaImageIO", meta_image_header.locate, meta_image_header.says_spacing, meta_image_header.says_sides)
_FORMATS = {
    ".nii.gz": _NIFTI, ".nii": _NIFTI, ".hdr": _PAIR, ".img": _PAIR,
    ".nrrd": _NRRD, ".nhdr": _NRRD, ".mha": _META_IMAGE, ".mhd": _META_IMAGE,
}  # fmt: skip
"""By the ending. Other formats of ITK (VTK, GIPL, MRC, TIFF, …) are left out: it reads truncated files without an error."""

VOLUME_ENDINGS = tuple(ending for ending in _FORMATS if ending != ".img")
"""Endings of files that stand for one volume; a pair of files is represented by its `.hdr`."""
