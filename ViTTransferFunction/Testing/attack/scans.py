"""Small scans of two structures, and their files in every format that is read, header by header, so that headers can lie."""

from __future__ import annotations

import gzip
import random
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK as sitk  # noqa: N813

NIFTI_HEADER = np.dtype([
    ("sizeof_hdr", "<i4"), ("data_type", "S10"), ("db_name", "S18"), ("extents", "<i4"), ("session_error", "<i2"),
    ("regular", "S1"), ("dim_info", "u1"), ("dim", "<i2", 8), ("intent_p", "<f4", 3), ("intent_code", "<i2"),
    ("datatype", "<i2"), ("bitpix", "<i2"), ("slice_start", "<i2"), ("pixdim", "<f4", 8), ("vox_offset", "<f4"),
    ("scl_slope", "<f4"), ("scl_inter", "<f4"), ("slice_end", "<i2"), ("slice_code", "u1"), ("xyzt_units", "u1"),
    ("cal_max", "<f4"), ("cal_min", "<f4"), ("slice_duration", "<f4"), ("toffset", "<f4"), ("glmax", "<i4"), ("glmin", "<i4"),
    ("descrip", "S80"), ("aux_file", "S24"), ("qform_code", "<i2"), ("sform_code", "<i2"), ("quatern", "<f4", 3),
    ("qoffset", "<f4", 3), ("srow", "<f4", (3, 4)), ("intent_name", "S16"), ("magic", "S4"),
])  # fmt: skip
NIFTI_TYPES = {"uint8": 2, "int16": 4, "int32": 8, "float32": 16, "float64": 64, "int8": 256, "uint16": 512, "uint32": 768}
NRRD_TYPES = {
    "uint8": "uchar", "int16": "short", "int32": "int", "float32": "float", "float64": "double", "int8": "signed char",
    "uint16": "ushort", "uint32": "uint", "int64": "longlong", "uint64": "ulonglong",
}  # fmt: skip
META_TYPES = {
    "uint8": "MET_UCHAR", "int16": "MET_SHORT", "int32": "MET_INT", "float32": "MET_FLOAT", "float64": "MET_DOUBLE",
    "int8": "MET_CHAR", "uint16": "MET_USHORT", "uint32": "MET_UINT",
}  # fmt: skip

SMALLEST_EDGE_MM = 3.0
"""Of shorter scans it is warned, since they may be in metres."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan with two structures, and one voxel in each.

    Attributes:
        array: (K, J, I).
        spacing: millimetres along I, J and K.
        direction: 3×3, of those axes in LPS.
        origin: of the first voxel, LPS millimetres.
        inside: i, j, k of a voxel of either structure.
    """

    array: np.ndarray
    spacing: np.ndarray
    direction: np.ndarray
    origin: np.ndarray
    inside: tuple[list[int], list[int]]

    @property
    def ijk_to_lps(self) -> np.ndarray:
        """3×4."""
        return np.column_stack([self.direction * self.spacing, self.origin])

    def image(self) -> sitk.Image:
        """As SimpleITK has it."""
        image = sitk.GetImageFromArray(self.array)
        image.SetSpacing(self.spacing.tolist())
        image.SetDirection(self.direction.ravel().tolist())
        image.SetOrigin(self.origin.tolist())
        return image


def make_scan(chance: random.Random, dtypes: tuple[str, ...] = tuple(NIFTI_TYPES)) -> Scan:
    """A scan of any small size, type, spacing and position."""
    noise = np.random.default_rng(chance.getrandbits(32))
    sizes = [chance.choice((2, 3, 5, 8, 11, 16, 17)) for _ in range(3)]
    if chance.random() < 0.5:
        sizes = [chance.randint(6, 20) for _ in range(3)]
    axis = int(np.argmax(sizes))
    sizes[axis] = max(sizes[axis], 6)
    level = np.zeros(sizes)
    index: list[Any] = [slice(None)] * 3
    index[axis] = slice(0, sizes[axis] // 3)
    level[tuple(index)] = 60.0
    index[axis] = slice(-(sizes[axis] // 3), None)
    level[tuple(index)] = 110.0
    dtype = chance.choice(dtypes)
    values = np.clip(level + noise.normal(5.0, 2.0, sizes), 0, 127)
    first, second = ([size // 2 for size in sizes] for _ in range(2))
    first[axis], second[axis] = 0, sizes[axis] - 1
    spacing = np.array([chance.choice((0.1, 0.5, 0.7, 1.0, 2.0, 3.0, 5.0, 12.0)) for _ in range(3)])
    if max(spacing * sizes) < SMALLEST_EDGE_MM:
        spacing *= 10.0
    origin = np.array([chance.uniform(-500.0, 500.0) for _ in range(3)]).round(2)
    # Arrays are (K, J, I), points (I, J, K).
    return Scan(np.ascontiguousarray(values.T.astype(dtype)), spacing, _direction(chance, noise), origin, (first, second))


def _direction(chance: random.Random, noise: np.random.Generator) -> np.ndarray:
    """Along the axes, permuted and mirrored, or any rotation."""
    if chance.random() < 0.4:
        return np.eye(3)
    if chance.random() < 0.5:
        return np.eye(3)[chance.sample(range(3), 3)] * [chance.choice((-1.0, 1.0)) for _ in range(3)]
    turned, _ = np.linalg.qr(noise.normal(size=(3, 3)))
    return turned


def nifti_header(scan: Scan) -> np.ndarray:
    """A true header; () of `NIFTI_HEADER`."""
    header = np.zeros((), NIFTI_HEADER)
    name = scan.array.dtype.name
    header["sizeof_hdr"], header["dim"] = 348, [3, *scan.array.shape[::-1], 1, 1, 1, 1]
    header["datatype"], header["bitpix"] = NIFTI_TYPES[name], scan.array.itemsize * 8
    header["pixdim"], header["vox_offset"], header["xyzt_units"] = [1, *scan.spacing, 0, 0, 0, 0], 352, 2
    header["sform_code"], header["srow"], header["magic"] = 1, np.diag([-1, -1, 1]) @ scan.ijk_to_lps, b"n+1"
    return header


def nifti(header: np.ndarray, array: np.ndarray) -> bytes:
    """The content of a `.nii` file."""
    return header.tobytes() + bytes(4) + array.tobytes()


def nrrd_fields(scan: Scan) -> dict[str, str]:
    """The fields of a true header."""
    directions = " ".join(f"({','.join(map(repr, map(float, column)))})" for column in (scan.direction * scan.spacing).T)
    return {
        "type": NRRD_TYPES[scan.array.dtype.name],
        "dimension": "3",
        "space": "left-posterior-superior",
        "sizes": " ".join(map(str, scan.array.shape[::-1])),
        "space directions": directions,
        "kinds": "domain domain domain",
        "endian": "little",
        "encoding": "raw",
        "space origin": f"({','.join(map(repr, map(float, scan.origin)))})",
    }


def nrrd(fields: Mapping[str, str], array: np.ndarray) -> bytes:
    """The content of a `.nrrd` file; compressed where the fields say so."""
    content = array.tobytes()
    if fields.get("encoding") in ("gzip", "gz"):
        content = gzip.compress(content, mtime=0)
    lines = ["NRRD0004", *(f"{name}: {value}" for name, value in fields.items())]
    return "\n".join(lines).encode() + b"\n\n" + content


def meta_fields(scan: Scan, element_data_file: str = "LOCAL") -> dict[str, str]:
    """The fields of a true MetaImage header."""
    return {
        "ObjectType": "Image",
        "NDims": "3",
        "BinaryData": "True",
        "BinaryDataByteOrderMSB": "False",
        "CompressedData": "False",
        "TransformMatrix": " ".join(repr(float(value)) for value in scan.direction.T.ravel()),
        "Offset": " ".join(repr(float(value)) for value in scan.origin),
        "CenterOfRotation": "0 0 0",
        "ElementSpacing": " ".join(repr(float(value)) for value in scan.spacing),
        "DimSize": " ".join(map(str, scan.array.shape[::-1])),
        "ElementType": META_TYPES[scan.array.dtype.name],
        "ElementDataFile": element_data_file,
    }


def meta(fields: Mapping[str, str], content: bytes) -> bytes:
    """The content of a `.mha` file, or of a `.mhd` file where there is no content."""
    return "".join(f"{name} = {value}\n" for name, value in fields.items()).encode() + content


def write_dicom(
    folder: Path,
    scan: Scan,
    series: str = "1.2.826.0.1.3680043.2.1125.1",
    first: int = 0,
    about: Mapping[str, str] | None = None,
) -> list[Path]:
    """Write a series, a file each slice; the voxels as int16. A left-handed scan comes back with its slices in reverse.

    Args:
        folder: where to.
        scan: what is in it.
        series: the beginning of its UIDs.
        first: number of the first slice, and name of its file.
        about: further elements of each slice, `"0008|103e"` say.
    """
    folder.mkdir(parents=True, exist_ok=True)
    image = sitk.Cast(scan.image(), sitk.sitkInt16)
    writer = sitk.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    direction = scan.direction
    orientation = "\\".join(f"{value:.8f}" for value in direction.T[:2].ravel())
    paths = []
    for k in range(image.GetDepth()):
        part = image[:, :, k]
        position = scan.ijk_to_lps @ [0, 0, k, 1]
        tags = {
            "0008|0060": "CT",
            "0020|000d": f"{series}.1",
            "0020|000e": f"{series}.2",
            "0008|0018": f"{series}.3.{first + k}",
            "0020|0013": str(first + k),
            "0020|0032": "\\".join(f"{value:.6f}" for value in position),
            "0020|0037": orientation,
        }
        for key, value in (tags | dict(about or {})).items():
            part.SetMetaData(key, value)
        paths.append(folder / f"{first + k:03d}.dcm")
        writer.SetFileName(str(paths[-1]))
        writer.Execute(part)
    return paths


def write_moved_dicom(folder: Path, scan: Scan, moves_mm: np.ndarray) -> list[Path]:
    """Write a series of which each slice lies elsewhere than a straight stack has it.

    Args:
        folder: where to.
        scan: what is in it.
        moves_mm: of each slice, (K, 3) LPS millimetres.
    """
    paths = []
    for k, move in enumerate(moves_mm):
        origin = scan.ijk_to_lps @ [0, 0, k, 1] + move
        paths += write_dicom(folder, Scan(scan.array[k : k + 1], scan.spacing, scan.direction, origin, scan.inside), first=k)
    return paths
