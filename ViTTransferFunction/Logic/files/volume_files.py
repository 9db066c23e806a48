"""Volumes from files: anything SimpleITK reads, or a folder with one DICOM series."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813 - the name that its own documentation uses

from ..core.errors import InputError
from ..core.geometry import LPS_TO_RAS, Geometry
from ..core.volume import Volume

logger = logging.getLogger(__name__)

LARGEST_SPACING_DEVIATION = 0.01
"""Relative deviation of slice distances above which a DICOM series is not a regular grid."""


def read_volume(path: Path) -> Volume:
    """Read a scalar 3D volume.

    Args:
        path: an image file, or a folder that holds one DICOM series.

    Raises:
        InputError: missing, unreadable, not a scalar 3D image, or nothing to be seen in it (`Volume`).
    """
    if not path.exists():
        raise InputError(f"There is no file or folder {path}.")
    image = _read_series(path) if path.is_dir() else _read_file(path)
    return Volume(sitk.GetArrayFromImage(image), image_geometry(image), name=_name(path))


def read_image(path: Path) -> sitk.Image:
    """Read a scalar 3D image file, of label numbers say. Raises InputError where it is none."""
    if not path.is_file():
        raise InputError(f"There is no file {path}.")
    return _read_file(path)


def image_geometry(image: sitk.Image) -> Geometry:
    """Geometry of a 3D SimpleITK image."""
    ijk_to_lps = np.eye(4)
    ijk_to_lps[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    ijk_to_lps[:3, 3] = image.GetOrigin()
    return Geometry(image.GetSize()[::-1], LPS_TO_RAS @ ijk_to_lps)


def _read_file(path: Path) -> sitk.Image:
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    try:
        # The header first: what cannot be used is refused before its voxels are read.
        reader.ReadImageInformation()
        _check_header(reader.GetSize(), reader.GetNumberOfComponents(), path)
        return reader.Execute()
    except RuntimeError as error:
        raise InputError(f"{path} cannot be read as an image: {last_line(error)}") from error


def _read_series(folder: Path) -> sitk.Image:
    series = sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(folder))
    if not series:
        raise InputError(f"The folder {folder} holds no DICOM series. Name an image file, or a folder with DICOM files.")
    files = {uid: sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder), uid) for uid in series}
    if len(series) > 1:
        listing = "; ".join(f"{uid} ({len(names)} files)" for uid, names in files.items())
        raise InputError(
            f"The folder {folder} holds {len(series)} DICOM series: {listing}. Put the one to use in a folder of its own."
        )
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(files[series[0]])
    try:
        _warn_of_irregular_slices(files[series[0]], folder)
        image = reader.Execute()
    except RuntimeError as error:
        raise InputError(f"The DICOM series in {folder} cannot be read: {last_line(error)}") from error
    _check_header(image.GetSize(), image.GetNumberOfComponentsPerPixel(), folder)
    return image


def _check_header(size: Sequence[int], components: int, path: Path) -> None:
    if len(size) != 3 or components != 1:
        kind = f"{len(size)}D image of size {'×'.join(map(str, size))}" + (
            f" with {components} components" if components > 1 else ""
        )
        raise InputError(
            f"{path} is a {kind}; expected a scalar 3D volume. Choose one channel or time point and save it alone."
        )


def _warn_of_irregular_slices(files: tuple[str, ...], folder: Path) -> None:
    """A missing or unevenly spaced slice shifts everything beyond it, so the user should know."""
    positions = np.array([_slice_position(name) for name in files])
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    if len(gaps) > 1 and np.ptp(gaps) > LARGEST_SPACING_DEVIATION * np.median(gaps):
        logger.warning(
            "%s: slice distances vary from %.2f to %.2f mm: slices may be missing, and positions beyond them off.",
            folder, gaps.min(), gaps.max(),
        )  # fmt: skip


def _slice_position(file_name: str) -> tuple[float, ...]:
    reader = sitk.ImageFileReader()
    reader.SetFileName(file_name)
    reader.ReadImageInformation()
    return tuple(reader.GetOrigin())


def _name(path: Path) -> str:
    name = path.resolve().name
    return name[: -len(".nii.gz")] if name.endswith(".nii.gz") else (name if path.is_dir() else path.stem)


def last_line(error: RuntimeError) -> str:
    """SimpleITK's own sentence, without the C++ source lines above it."""
    return str(error).strip().splitlines()[-1].strip()
