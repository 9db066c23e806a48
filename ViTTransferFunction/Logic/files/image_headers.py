"""Headers of the image formats that volumes are read from, as far as they say where the voxels are.

ITK reads the headers for all else. It must not see some of them: it crashes, hangs, or reads another file than was named.

- NIfTI-1: nifti1.h of the NIfTI data format working group; Analyze 7.5 has the same fields where they are read here.
- MetaImage: the documentation of MetaIO.
- NRRD: the definition of the format, version 5, of Teem.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..core.system.errors import InputError, shown
from ..core.system.regular_file import check_regular_file, mode_of
from .length_units import check_units
from .nifti_place import check_place, nifti_says_place
from .stored_voxels import StoredVoxels

_NIFTI_BYTES = 348
_LONGEST_HEADER = 1 << 20
_GZIP = b"\x1f\x8b"

DICOM_START_BYTES = 132
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
    """

    reader: str
    locate: Callable[[Path, bytes], StoredVoxels | None]


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
        return _nrrd_fields(read_start(path, _LONGEST_NRRD_HEADER)).get("datafile")
    is_meta_image = path.name.lower().endswith((".mha", ".mhd"))
    if is_meta_image and (last_line := _META_DATA_FILE.search(read_start(path) + b"\n")):
        name = _meta_data_file(last_line)
        return None if name.lower() == "local" else name
    return None


def says_spacing(path: Path) -> bool:
    """Whether the header of a file says how far apart its voxels are along all three axes.

    Where it does not, ITK, and so Slicer, takes 1 mm. In NRRD, joined slices have a spacing that is no number, and so have axes
    that are none of space.

    Raises:
        InputError: the file cannot be read, or is of no known format.
    """
    reader, start = image_format(path).reader, read_start(path)
    if reader == "NrrdImageIO":
        fields = _nrrd_fields(start)
        numbers = [number for number in fields.get("spacings", "").split() if re.search(r"\d", number)]
        return len(numbers) >= 3 or bool(re.search(r"\d", fields.get("spacedirections", "")))
    if reader == "MetaImageIO":
        return not {"ElementSpacing", "ElementSize"}.isdisjoint(_fields(start, "="))
    return True


def says_sides(path: Path) -> bool:
    """Whether the header of a file says which sides of the patient its axes lead to.

    Where it does not, ITK, and so Slicer, takes them for left, back and head.

    Raises:
        InputError: the file cannot be read, is of no known format, or its header cannot be used.
    """
    reader, start = image_format(path).reader, read_start(path)
    if reader == "NrrdImageIO":
        return bool(_PATIENT_SPACE.fullmatch(_nrrd_fields(start).get("space", "")))
    if reader == "MetaImageIO":
        return not {"TransformMatrix", "Rotation", "Orientation"}.isdisjoint(_fields(start, "="))
    is_pair = path.suffix.lower() in (".hdr", ".img")
    header, _ = _nifti_header(path, read_start(_sibling(path, ".hdr")) if is_pair else start)
    return nifti_says_place(header, _byte_order(path, header))


def is_dicom_start(start: bytes) -> bool:
    """Whether a file's first `DICOM_START_BYTES` are those of DICOM."""
    return start[128:] == b"DICM"


def read_start(path: Path, count: int = _LONGEST_HEADER) -> bytes:
    """The file's first bytes: by default as many as hold all of a header.

    Raises:
        InputError: it is no ordinary file, or cannot be read.
    """
    check_regular_file(path)
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise InputError(f"Cannot read {path}: {error.strerror or error}.") from error


def _in_nifti(path: Path, start: bytes) -> StoredVoxels:
    header, compressed = _nifti_header(path, start)
    if compressed and not path.name.lower().endswith(".gz"):
        raise InputError(f"{path} is compressed; give it the ending .nii.gz.")
    order = _byte_order(path, header)
    if header[344:348] == b"ni1\0":
        raise InputError(f"{path} is one half of a pair of files; name the .hdr file, or save it as .nii.")
    if header[344:348] != b"n+1\0":
        raise InputError(f"{path} is no NIfTI file: its header lacks the signature.")
    voxels, offset = _nifti_voxels(path, header, order)
    offset = max(offset, _NIFTI_BYTES)
    if compressed:
        return replace(voxels, compressed=True, skipped=offset)
    return replace(voxels, start=offset)


def _in_nifti_pair(path: Path, start: bytes) -> StoredVoxels:
    """Header and voxels in files of one name: NIfTI of two files, or Analyze."""
    header_path = _sibling(path, ".hdr")
    _check_is_there(path, "header", header_path)
    header = start if header_path == path else read_start(header_path)
    order = _byte_order(header_path, header)
    if header[344:348] == b"n+1\0":
        raise InputError(f"{header_path} says that it holds its voxels itself; give it the ending .nii.")
    voxels, offset = _nifti_voxels(header_path, header, order)
    voxels_path = _sibling(path, ".img")
    _check_is_there(path, "voxels", voxels_path)
    return replace(voxels, path=voxels_path, start=offset)


def _sibling(path: Path, ending: str) -> Path:
    """The other file of a pair, whose ending is in the same case."""
    return path.with_suffix(ending.upper() if path.suffix.isupper() else ending)


def _nifti_header(path: Path, start: bytes) -> tuple[bytes, bool]:
    """The header, and whether the file is compressed."""
    if not start.startswith(_GZIP):
        return start, False
    try:
        return zlib.decompressobj(zlib.MAX_WBITS | 32).decompress(start, 4 * _NIFTI_BYTES), True
    except zlib.error as error:
        raise InputError(f"{path} is damaged: it cannot be unpacked. Copy or save it again.") from error


def _byte_order(path: Path, header: bytes) -> str:
    if len(header) < _NIFTI_BYTES:
        raise InputError(f"{path} is no NIfTI file: it has {len(header)} bytes, and a header alone has {_NIFTI_BYTES}.")
    if 540 in struct.unpack_from("<i", header) + struct.unpack_from(">i", header):
        raise InputError(f"{path} is a NIfTI-2 file; expected NIfTI-1. Save it as that, or as NRRD.")
    for order in "<>":
        if struct.unpack_from(order + "i", header) == (_NIFTI_BYTES,):
            return order
    raise InputError(f"{path} is no NIfTI file: its header does not begin with its own length.")


_NIFTI_TYPES = {1: (2, 256), 2: (4, 512), 4: (8, 16, 768), 8: (64, 1024, 1280)}
_NIFTI_VOXEL_BYTES = {kind: size for size, kinds in _NIFTI_TYPES.items() for kind in kinds}
"""By the code of the type."""

_NIFTI_NO_INTENSITIES = {32: "complex numbers", 1792: "complex numbers", 128: "colours", 2304: "colours"}


_NIFTI_FLOATS = {16: "f4", 64: "f8"}
"""Of which ITK makes zeros where they are not finite: a CT beyond its field of view, say, would be of water."""


def _nifti_voxels(path: Path, header: bytes, order: str) -> tuple[StoredVoxels, int]:
    """Of what kind the voxels are, and where the first one is; refuses what ITK would replace by a guess."""
    sizes = struct.unpack_from(order + "8h", header, 40)
    (kind,) = struct.unpack_from(order + "h", header, 70)
    spacing = np.array(struct.unpack_from(order + "8f", header, 76))
    (offset,) = struct.unpack_from(order + "f", header, 108)
    if kind in _NIFTI_NO_INTENSITIES:
        raise InputError(
            f"{path} holds {_NIFTI_NO_INTENSITIES[kind]}; expected one intensity a voxel, in shades of grey. Open the scan "
            "that it was made of, or save one channel alone."
        )
    if kind not in _NIFTI_VOXEL_BYTES:
        raise InputError(f"{path} holds voxels of the type {kind}, which is not known; save it as 16-bit integers, say.")
    if not 0.0 <= offset < 2.0**31:
        raise InputError(f"{path} says that its voxels begin at byte {offset:g}; its header is damaged.")
    axes = max(0, min(sizes[0], 3))
    if min(sizes[1 : 1 + axes], default=1) < 1:
        raise InputError(f"{path} is {'×'.join(map(str, sizes[1 : 1 + axes]))} voxels; its header is damaged.")
    if not np.isfinite(spacing[1 : 1 + axes]).all() or (spacing[1 : 1 + axes] == 0.0).any():
        raise InputError(
            f"{path} has the spacing {' × '.join(f'{mm:g}' for mm in spacing[1 : 1 + axes])} mm; its header is damaged. "
            "Save it again with the spacing that it was taken at."
        )
    check_place(path, header, order)
    floats = np.dtype(order + _NIFTI_FLOATS[kind]) if kind in _NIFTI_FLOATS else None
    return StoredVoxels(path, voxel_bytes=_NIFTI_VOXEL_BYTES[kind], floats=floats), int(offset)


_META_DATA_FILE = re.compile(rb"^[ \t]*ElementDataFile[ \t]*[=:][ \t]*([^\r\n]*)\r?\n", re.MULTILINE)


def _in_meta_image(path: Path, start: bytes) -> StoredVoxels:
    last_line = _META_DATA_FILE.search(start + b"\n")
    if last_line is None:
        raise InputError(f"{path} is no MetaImage: its header has no line 'ElementDataFile = …'.")
    fields = _fields(start[: last_line.start()], "=")
    name = _meta_data_file(last_line)
    # MetaIO hangs with fewer, and its tables have room for ten.
    if not re.fullmatch(r"[1-9]|10", fields.get("NDims", "3")):
        raise InputError(f"{path} says that it has {shown(fields['NDims'])} dimensions; expected 3.")
    if fields.get("BinaryData", "True")[:1] not in ("T", "t", "1"):
        raise InputError(f"{path} holds its voxels as text; save it with binary ones.")
    check_units(path, [fields.get("DistanceUnits", "")])
    compressed = fields.get("CompressedData", "False")[:1] in ("T", "t", "1")
    header_size = fields.get("HeaderSize", "0")
    if name.lower() == "local":
        if header_size not in ("0", "-1"):
            raise InputError(f"{path}: 'HeaderSize = {header_size}' contradicts 'ElementDataFile = LOCAL'; save it again.")
        return StoredVoxels(path, last_line.end(), compressed)
    # MetaIO makes a number of the part behind %, whatever it is, and crashes.
    if "%" in name or name.split(maxsplit=1)[:1] == ["LIST"] or not name:
        raise InputError(f"{path} names its voxels' files by '{name}'; expected the name of one file. Save it as .mha.")
    if not re.fullmatch(r"-1|\d{1,18}", header_size) or (compressed and header_size != "0"):
        raise InputError(f"{path}: 'HeaderSize = {header_size}' cannot be used; save it again.")
    voxels = _named_file(path, name)
    return StoredVoxels(voxels, None if header_size == "-1" else int(header_size), compressed)


def _meta_data_file(last_line: re.Match[bytes]) -> str:
    return last_line[1].decode("utf-8", "surrogateescape").strip()


_NRRD_END = re.compile(rb"\r?\n\r?\n")
_LONGEST_NRRD_HEADER = 1 << 26
"""Of thousands of segments, each has some three hundred bytes beside its name."""

_LONGEST_NRRD_VALUE = 500
"""Teem writes what it complains of, which may be a whole field, into room for a thousand characters, and crashes."""


def _in_nrrd(path: Path, start: bytes) -> StoredVoxels | None:
    if not start.startswith(b"NRRD"):
        raise InputError(f"{path} cannot be read as an image: it is no NRRD file, which would begin with the letters NRRD.")
    end = _NRRD_END.search(start)
    if end is None and len(start) == _LONGEST_HEADER:
        start = read_start(path, _LONGEST_NRRD_HEADER)
        end = _NRRD_END.search(start)
    fields = _nrrd_fields(start)
    for field, value in fields.items():
        if len(value) > _LONGEST_NRRD_VALUE and field not in ("content", "datafile"):
            raise InputError(f"{path} is damaged: its header has {len(value)} characters for {field[:40]!r}. Save it again.")
    for field in ("spaceunits", "units"):
        check_units(path, re.findall('"([^"]*)"', fields.get(field, "")))
    name = fields.get("datafile")
    if name is not None:
        # Teem takes a minus sign for the standard input.
        if name == "-" or "%" in name or name.split(maxsplit=1)[:1] == ["LIST"]:
            raise InputError(f"{path} names its voxels' files by '{name}'; expected the name of one file. Save it as .nrrd.")
        voxels, first = _named_file(path, name), 0
    else:
        if end is None:
            raise InputError(f"{path} is cut off: its header does not end. Copy or save it again.")
        voxels, first = path, end.end()
    encoding = fields.get("encoding", "").lower()
    # Teem crashes on what is no text after all.
    if encoding in ("ascii", "text", "txt", "hex"):
        raise InputError(f"{path} holds its voxels as text; save it with binary ones.")
    if encoding in ("bzip2", "bz2"):
        raise InputError(f"{path} holds its voxels compressed by bzip2; expected gzip, or none. Save it with that.")
    plain_or_gzip = {"raw": False, "gzip": True, "gz": True}.get(encoding)
    # Teem itself notices what other encodings lack, and what has been put before the voxels is its to skip.
    if plain_or_gzip is None or {fields.get("lineskip", "0"), fields.get("byteskip", "0")} != {"0"}:
        return None
    return StoredVoxels(voxels, first, plain_or_gzip)


_PATIENT_SPACE = re.compile(r"(RAS|LAS|LPS|(right|left)-(anterior|posterior)-superior)(T|-time)?", re.IGNORECASE)


def _nrrd_fields(start: bytes) -> dict[str, str]:
    """What a header says of the voxels: values by field, in lower case and without spaces."""
    end = _NRRD_END.search(start)
    lines = _fields(start[: end.start() if end else None], ":")
    # A value that begins with = is a key's, which says nothing about the voxels, and may have any length.
    return {field.lower().replace(" ", ""): value for field, value in lines.items() if not value.startswith("=")}


def _named_file(header: Path, name: str) -> Path:
    """The file that a header names, which lies beside it unless the name says otherwise."""
    file = header.parent / name
    _check_is_there(header, "voxels", file)
    return file


def _check_is_there(path: Path, what: str, other: Path) -> None:
    """Raise InputError unless the other one of two files can be opened, which nobody has named: it has a part of the image."""
    if mode_of(other) is None:
        raise InputError(
            f"{path} has its {what} in another file, {other.name}, which is not there. Put both into one folder; on the app's "
            "page, open both at once."
        )
    check_regular_file(other)


def _fields(header: bytes, separator: str) -> dict[str, str]:
    """Lines `key separator value`."""
    # Not `splitlines`, which also breaks lines at characters of Unicode that may stand in a name.
    lines = (line.partition(separator) for line in header.decode("utf-8", "surrogateescape").split("\n"))
    return {key.strip(): value.strip() for key, found, value in lines if found}


_FORMATS = {
    ".nii.gz": ImageFormat(NIFTI_READER, _in_nifti),
    ".nii": ImageFormat(NIFTI_READER, _in_nifti),
    ".hdr": ImageFormat(NIFTI_READER, _in_nifti_pair),
    ".img": ImageFormat(NIFTI_READER, _in_nifti_pair),
    ".nrrd": ImageFormat("NrrdImageIO", _in_nrrd),
    ".nhdr": ImageFormat("NrrdImageIO", _in_nrrd),
    ".mha": ImageFormat("MetaImageIO", _in_meta_image),
    ".mhd": ImageFormat("MetaImageIO", _in_meta_image),
}
"""By the ending. Of other formats that ITK knows (VTK, GIPL, MRC, TIFF, …) it makes a volume even where they were cut off."""

VOLUME_ENDINGS = tuple(ending for ending in _FORMATS if ending != ".img")
"""Of files that are one volume; the other half of a pair is its `.hdr`."""
