"""The formats that volumes are read from, and what their headers say of the voxels.

ITK reads the headers for all else. It must not see some of them: it crashes, hangs, or reads another file than was named.
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
"""In which scans often come from hospitals and public collections."""
SEGMENTATION_ENDING = ".seg.nrrd"
"""Of Slicer's segmentations."""


@dataclass(frozen=True)
class ImageFormat:
    """A format of image files.

    Attributes:
        reader: the name of ITK's reader.
        locate: finds the voxels of a file of this format, whose first bytes are given; None: the reader itself notices what is
            missing. Raises InputError where the header cannot be used.
        says_spacing: whether a header, given by the file's first bytes, says how far apart voxels are along all three axes.
        says_sides: whether the header of a file, whose first bytes are given, says which sides of the patient its axes lead
            to. Raises InputError where it cannot be used.
        header: the file with the header, where a file of this format is given.
    """

    reader: str
    locate: Callable[[Path, bytes], StoredVoxels | None]
    says_spacing: Callable[[bytes], bool] = lambda _start: True
    says_sides: Callable[[Path, bytes], bool] = lambda _path, _start: True
    header: Callable[[Path], Path] = lambda path: path


def image_format(path: Path) -> ImageFormat:
    """The format that a file is of: DICOM under any name, since many call its slices `.img`; else by its ending in any case.

    Raises:
        InputError: it cannot be read, or is of none whose completeness can be checked.
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
    """Raise an InputError if a file is an archive by its name, which the message shows as it is."""
    if name.lower().endswith(_ARCHIVE_ENDINGS):
        raise InputError(f"{name} is an archive. Unpack it, and open the image in it, or the folder with the DICOM files.")


def image_ending(path: Path) -> str | None:
    """The ending, in lower case, that says the file's format; None where it says none."""
    return next((ending for ending in _FORMATS if path.name.lower().endswith(ending)), None)


def volume_ending(path: Path) -> str | None:
    """The ending, in lower case, of a file that is one volume, for those who look for volumes in a folder; None: it is none.

    Neither are segmentations, nor the half of a pair of files that holds the voxels.
    """
    ending = image_ending(path)
    return ending if ending in VOLUME_ENDINGS and not path.name.lower().endswith(SEGMENTATION_ENDING) else None


def locate_voxels(path: Path) -> StoredVoxels | None:
    """Where an image file's voxels are; None where its reader itself notices what is missing.

    Raises:
        InputError: the file cannot be read, is of no known format, or its header cannot be used.
    """
    return image_format(path).locate(path, read_start(path))


def named_voxels(path: Path) -> str | None:
    """What the header of an image file says where its voxels are, as it is written; None: in the file itself.

    Of a list of files, only its beginning.

    Raises:
        InputError: the file cannot be read.
    """
    # Teem goes by the first letters, MetaIO by the name.
    if read_start(path, 4) == b"NRRD":
        return nrrd_header.named_voxels(path)
    is_meta_image = path.name.lower().endswith((".mha", ".mhd"))
    return meta_image_header.named_voxels(read_start(path)) if is_meta_image else None


def says_spacing(path: Path) -> bool:
    """Whether the header of a file says how far apart its voxels are; where it does not, ITK, and so Slicer, takes 1 mm.

    Raises:
        InputError: the file cannot be read, or is of no known format.
    """
    return image_format(path).says_spacing(read_start(path))


def says_sides(path: Path) -> bool:
    """Whether the header of a file says which sides of the patient its axes lead to.

    Where it does not, ITK, and so Slicer, takes them for left, back and head.

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
"""By the ending. Of other formats that ITK knows (VTK, GIPL, MRC, TIFF, …) it makes a volume even where they were cut off."""

VOLUME_ENDINGS = tuple(ending for ending in _FORMATS if ending != ".img")
"""Of files that are one volume; the other half of a pair is its `.hdr`."""
