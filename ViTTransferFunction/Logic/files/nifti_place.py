"""Where a NIfTI-1 header says that its voxels lie: refused where ITK would guess, or give a wrong reason.

nifti1.h of the NIfTI data format working group: `sform` is a matrix, `qform` a rotation as a quaternion and a shift. Where both
have a code, ITK, and so Slicer, goes by `sform` only if that has axes and the code of the scanner's own coordinates; with that
of an atlas, say, it goes by `qform`. Of one that has a code alone it goes by that. It knows that both are in the units
of `xyzt_units`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.system.errors import InputError
from ..core.volumes.geometry import Geometry
from .straightening import LARGEST_DEVIATION

SCANNER = 1
"""The code of coordinates that are the scanner's own, NIFTI_XFORM_SCANNER_ANAT."""

_UNIT_OF_SPACE, _UNITS_MM = 7, {1: 1000.0, 3: 0.001}
"""The bits of `xyzt_units` that are of lengths, and those that are no millimetres: NIFTI_UNITS_METER and _MICRON."""

LONGEST_QUATERNION = 1.01
"""Sum of the squares of b, c and d, which no rotation has beyond 1 but by rounding."""


def check_place(path: Path, header: bytes, order: str) -> None:
    """Raise InputError where a header does not say where its voxels lie, though it promises to.

    Args:
        path: of the file, for messages.
        header: its first 348 bytes.
        order: of bytes, as `struct` writes it.
    """
    if _is_analyze(header):
        return
    qform_code, sform_code = _codes(header, order)
    has_qform, has_sform = qform_code > 0, sform_code > 0
    qform = np.array(struct.unpack_from(order + "6f", header, 256))
    sform = np.array(struct.unpack_from(order + "12f", header, 280)).reshape(3, 4)
    for name, there, place in (("qform", has_qform, qform), ("sform", has_sform, sform)):
        if there and not np.isfinite(place).all():
            raise InputError(f"{path}: its header's {name}, which says where it lies, has values that are no numbers.")
    has_axes = has_sform and np.linalg.matrix_rank(sform[:, :3]) == 3
    if has_sform and not has_axes and not has_qform:
        axes = ", ".join(f"({', '.join(f'{number:g}' for number in axis)})" for axis in sform[:, :3].T)
        raise InputError(
            f"{path} does not say where it lies: its header's sform gives its axes as {axes}, and there is no qform; expected "
            "three different directions. Save it again from its source."
        )
    if has_qform and not (has_axes and sform_code == SCANNER) and (qform[:3] ** 2).sum() > LONGEST_QUATERNION:
        quaternion = ", ".join(f"{number:g}" for number in qform[:3])
        raise InputError(
            f"{path} does not say where it lies: its header's qform has the quaternion {quaternion}, which is no rotation: the "
            "sum of its squares exceeds 1. Save it again from its source."
        )


def nifti_says_place(header: bytes, order: str) -> bool:
    """Whether a header has a `qform` or a `sform`, as that of Analyze never has; arguments as for `check_place`."""
    return not _is_analyze(header) and max(_codes(header, order)) > 0


def _is_analyze(header: bytes) -> bool:
    """Whether it is of Analyze, which has other fields where NIfTI says how a volume lies."""
    return header[344:347] not in (b"n+1", b"ni1")


def _codes(header: bytes, order: str) -> tuple[int, int]:
    """Of `qform` and of `sform`."""
    qform_code, sform_code = struct.unpack_from(order + "2h", header, 252)
    return qform_code, sform_code


def warn_of_place(path: Path, image: sitk.Image, geometry: Geometry, on_warning: Callable[[str], None]) -> None:
    """Warn where ITK, and so Slicer, has a scan elsewhere or larger than its `sform` or other programs, of one reason at most.

    Args:
        path: of the NIfTI file.
        image: as ITK read it.
        geometry: of the image.
        on_warning: is told how far off positions are, along which axes it is mirrored, or which two sizes its voxels have.
    """
    told = _mirrored(image)
    sform = _sform(image)
    if not told and sform is not None:
        told = _lost_shift(image, sform) or _other_size(image, sform) or _other_place(image, sform, geometry)
    if told:
        on_warning(f"{path}{told}")


def _mirrored(image: sitk.Image) -> str:
    """What to tell where a size of voxels is below zero beside a place: other programs pass over the sign; "" elsewhere."""
    if not any(image.HasMetaDataKey(code) and image.GetMetaData(code) != "0" for code in ("qform_code", "sform_code")):
        return ""
    mirrored = [name for axis, name in enumerate("ijk", start=1) if float(image.GetMetaData(f"pixdim[{axis}]")) < 0.0]
    if not mirrored:
        return ""
    return (
        f" has voxel sizes below zero along {' and '.join(mirrored)}. It is read mirrored there, as 3D Slicer does, and other "
        "programs do not: left and right may be exchanged. Check the sides, or save it again from its source."
    )


def _sform(image: sitk.Image) -> np.ndarray | None:
    """The matrix (3, 4), in the header's own unit; None where there is none that has axes."""
    if not image.HasMetaDataKey("sform_code") or image.GetMetaData("sform_code") == "0":
        return None
    sform = np.array([[float(number) for number in image.GetMetaData(f"srow_{axis}").split()[:4]] for axis in "xyz"])
    return sform if np.linalg.matrix_rank(sform[:, :3]) == 3 else None


def _lost_shift(image: sitk.Image, sform: np.ndarray) -> str:
    """What to tell where slices are shifted against each other by `sform`: ITK then goes by `qform`, which cannot say that."""
    spacing, (*_, slices) = image.GetSpacing()[:3], image.GetSize()[:3]
    along, across, step = sform[:, :3].T * (spacing[0] / np.linalg.norm(sform[:, 0]))  # In millimetres, whatever the unit.
    normal = np.cross(along, across)
    shift_mm = (slices - 1) * float(np.linalg.norm(step - (step @ normal) / (normal @ normal) * normal))
    if shift_mm <= LARGEST_DEVIATION * min(spacing):
        return ""
    return (
        f": by its header's sform, slices are shifted against each other by up to {shift_mm:.1f} mm, as with a tilted gantry. "
        "It is read by the qform, as 3D Slicer does, which has them straight above each other: positions are off by as much. "
        "Name the folder with the DICOM files instead."
    )


def _other_size(image: sitk.Image, sform: np.ndarray) -> str:
    """What to tell where voxels have another size by `sform` than by `pixdim`, which ITK takes it from whatever `sform` says.

    Nothing of a `sform` that enlarges the scan onto an atlas, and stands beside a `qform` of the scanner.
    """
    if image.GetMetaData("qform_code") != "0" and image.GetMetaData("sform_code") != str(SCANNER):
        return ""
    sizes_mm, by_sform_mm = np.array(image.GetSpacing()[:3]), np.linalg.norm(sform[:, :3], axis=0) * _in_a_unit_mm(image)
    off_mm = np.abs(by_sform_mm - sizes_mm) * (np.array(image.GetSize()[:3]) - 1)
    if off_mm.max() <= LARGEST_DEVIATION * sizes_mm.min():
        return ""
    stated, other = (" × ".join(f"{mm:.4g}" for mm in sizes) for sizes in (sizes_mm, by_sform_mm))
    return (
        f" has voxels of two sizes by its header: {stated} mm in pixdim, and {other} mm by its sform. It is read with those of "
        "pixdim, as 3D Slicer does. If these are not what it was taken at, all volumes and distances are wrong: save it again "
        "from its source."
    )


def _in_a_unit_mm(image: sitk.Image) -> float:
    """Millimetres in a unit of length of the header."""
    return _UNITS_MM.get(int(image.GetMetaData("xyzt_units")) & _UNIT_OF_SPACE, 1.0)


def _other_place(image: sitk.Image, sform: np.ndarray, geometry: Geometry) -> str:
    """What to tell where ITK goes by a `qform` that leads elsewhere, as after a registration to another scan by SPM."""
    last = np.array(geometry.shape[::-1]) - 1
    corners = np.array(list(product(*((0, index) for index in last))), dtype=float)
    by_sform = (corners @ sform[:, :3].T + sform[:, 3]) * _in_a_unit_mm(image)
    off_mm = float(np.linalg.norm(by_sform - geometry.ijk_to_ras_points(corners), axis=1).max())
    if off_mm <= LARGEST_DEVIATION * float(geometry.spacing_mm.min()):
        return ""
    return (
        f" lies in two places by its header, up to {off_mm:.1f} mm apart. It is read by the qform, as 3D Slicer does. Programs "
        "that go by the sform, such as FSL and nibabel, have points elsewhere, and show segmentations beside the scan. To "
        "use those as well, save it again with one place."
    )
