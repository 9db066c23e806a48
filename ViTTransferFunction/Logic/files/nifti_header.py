"""Headers of NIfTI-1, and of Analyze 7.5, whose fields are the same as far as they are read here.

Written after nifti1.h of the NIfTI Data Format Working Group. `nifti_place` reads the position of the volume in space.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..core.system.errors import InputError
from .file_start import read_start
from .header_parts import check_is_there
from .nifti_place import check_place, nifti_says_place
from .stored_voxels import StoredVoxels

_HEADER_BYTES = 348
_GZIP = b"\x1f\x8b"
_TYPES = {1: (2, 256), 2: (4, 512), 4: (8, 16, 768), 8: (64, 1024, 1280)}
_VOXEL_BYTES = {kind: size for size, kinds in _TYPES.items() for kind in kinds}
"""Bytes per voxel, by data type code."""
_NO_INTENSITIES = {32: "complex numbers", 1792: "complex numbers", 128: "colours", 2304: "colours"}
_FLOATS = {16: "f4", 64: "f8"}
"""Floating-point types. ITK replaces their non-finite values by 0, which in a CT outside the field of view would mean water."""


def locate(path: Path, start: bytes) -> StoredVoxels:
    """Where the voxels of a single-file NIfTI are.

    Args:
        path: of the file.
        start: its first bytes.

    Raises:
        InputError: the header cannot be used.
    """
    header, compressed = _header(path, start)
    if compressed and not path.name.lower().endswith(".gz"):
        raise InputError(f"{path} is compressed; give it the ending .nii.gz.")
    order = _byte_order(path, header)
    if header[344:348] == b"ni1\0":
        raise InputError(f"{path} is one half of a pair of files; name the .hdr file, or save it as .nii.")
    if header[344:348] != b"n+1\0":
        raise InputError(f"{path} is no NIfTI file: its header lacks the signature.")
    voxels, offset = _voxels(path, header, order)
    offset = max(offset, _HEADER_BYTES)
    if compressed:
        return replace(voxels, compressed=True, skipped=offset)
    return replace(voxels, start=offset)


def locate_of_pair(path: Path, start: bytes) -> StoredVoxels:
    """Where the voxels of a pair of files are, of which one has the header: two-file NIfTI, or Analyze.

    Args:
        path: of either file.
        start: its first bytes.

    Raises:
        InputError: a file of the pair is missing, or the header cannot be used.
    """
    header_path = header_of_pair(path)
    check_is_there(path, "header", header_path)
    header = start if header_path == path else read_start(header_path)
    order = _byte_order(header_path, header)
    if header[344:348] == b"n+1\0":
        raise InputError(f"{header_path} says that it holds its voxels itself; give it the ending .nii.")
    voxels, offset = _voxels(header_path, header, order)
    voxels_path = _sibling(path, ".img")
    check_is_there(path, "voxels", voxels_path)
    return replace(voxels, path=voxels_path, start=offset)


def says_sides(path: Path, start: bytes) -> bool:
    """Whether the header of a file, given its first bytes, states the anatomical directions of its axes.

    Raises:
        InputError: the header cannot be used.
    """
    header, _ = _header(path, start)
    return nifti_says_place(header, _byte_order(path, header))


def says_sides_of_pair(path: Path, _start: bytes) -> bool:
    """The same for a pair of files, of which `path` is either one."""
    return says_sides(path, read_start(header_of_pair(path)))


def header_of_pair(path: Path) -> Path:
    """The file with the header, given either file of a pair."""
    return _sibling(path, ".hdr")


def _sibling(path: Path, ending: str) -> Path:
    """The file of a pair with this ending, in upper case if the given file's ending is."""
    return path.with_suffix(ending.upper() if path.suffix.isupper() else ending)


def _header(path: Path, start: bytes) -> tuple[bytes, bool]:
    """The header, and whether the file is compressed."""
    if not start.startswith(_GZIP):
        return start, False
    try:
        return zlib.decompressobj(zlib.MAX_WBITS | 32).decompress(start, 4 * _HEADER_BYTES), True
    except zlib.error as error:
        raise InputError(f"{path} is damaged: it cannot be unpacked. Copy or save it again.") from error


def _byte_order(path: Path, header: bytes) -> str:
    if len(header) < _HEADER_BYTES:
        raise InputError(f"{path} is no NIfTI file: it has {len(header)} bytes, and a header alone has {_HEADER_BYTES}.")
    if 540 in struct.unpack_from("<i", header) + struct.unpack_from(">i", header):
        raise InputError(f"{path} is a NIfTI-2 file; expected NIfTI-1. Save it as that, or as NRRD.")
    for order in "<>":
        if struct.unpack_from(order + "i", header) == (_HEADER_BYTES,):
            return order
    raise InputError(f"{path} is no NIfTI file: its header does not begin with its own length.")


def _voxels(path: Path, header: bytes, order: str) -> tuple[StoredVoxels, int]:
    """The type of the voxels, and the offset of the first one; raises InputError if ITK would guess instead."""
    sizes = struct.unpack_from(order + "8h", header, 40)
    (kind,) = struct.unpack_from(order + "h", header, 70)
    spacing = np.array(struct.unpack_from(order + "8f", header, 76))
    (offset,) = struct.unpack_from(order + "f", header, 108)
    if kind in _NO_INTENSITIES:
        raise InputError(
            f"{path} holds {_NO_INTENSITIES[kind]}; expected one intensity a voxel, in shades of grey. Open the scan "
            "that it was made of, or save one channel alone."
        )
    if kind not in _VOXEL_BYTES:
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
    floats = np.dtype(order + _FLOATS[kind]) if kind in _FLOATS else None
    return StoredVoxels(path, voxel_bytes=_VOXEL_BYTES[kind], floats=floats), int(offset)
