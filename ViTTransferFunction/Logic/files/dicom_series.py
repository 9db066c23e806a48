"""DICOM series: a folder's slices as one image, where they are a stack on a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.errors import InputError
from ..core.regular_file import check_regular_file
from .dicom_frames import check_frames
from .image_headers import DICOM_START_BYTES, is_dicom_start, read_start
from .itk_errors import last_line

LARGEST_SPACING_DEVIATION = 0.01
"""Relative deviation of slice distances above which a DICOM series is not a regular grid; and of slices from lying straight
above each other, and from being parallel."""

NO_SLICES = (".nrrd", ".nii", ".nii.gz", ".mha", ".json", ".png", ".gif", ".mp4", ".ds_store", "thumbs.db", "desktop.ini")
"""Endings, in small letters, of files that are no slices and may be written again and again beside a DICOM series: results, and
what systems write where a folder is looked at."""


def read_series(folder: Path, on_warning: Callable[[str], None]) -> sitk.Image:
    """Read the one DICOM series of a folder.

    Args:
        folder: with its slices.
        on_warning: is told where slices are missing or shifted, so that positions are off.

    Raises:
        InputError: there is none or several, it cannot be read, or its slices are no stack.
    """
    for entry in _entries(folder):
        # GDCM would open it, and wait.
        if not entry.is_dir():
            check_regular_file(entry)
    try:
        series = sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(folder))
        files = {uid: sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder), uid) for uid in series}
    except RuntimeError as error:
        # Of an enhanced image whose frames do not say where they lie, say.
        raise InputError(f"The DICOM files in {folder} cannot be read: {last_line(error)}") from error
    if not series:
        raise InputError(f"The folder {folder} holds no DICOM series. Name an image file, or a folder with DICOM files.")
    if len(series) > 1:
        listing = "; ".join(f"{uid} ({len(names)} files)" for uid, names in files.items())
        raise InputError(
            f"The folder {folder} holds {len(series)} DICOM series: {listing}. Put the one to use in a folder of its own."
        )
    _warn_of_unread_files(folder, files[series[0]], on_warning)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(files[series[0]])
    try:
        headers = [_slice_header(name) for name in files[series[0]]]
        _check_slices(files[series[0]], headers, folder, on_warning)
        if len({header.kind for header in headers}) > 1:
            # ITK makes all slices numbers of the first one's kind: fractions would be cut, and large numbers become others.
            reader.SetOutputPixelType(sitk.sitkFloat32)
        image = reader.Execute()
    except RuntimeError as error:
        raise InputError(f"The DICOM series in {folder} cannot be read: {last_line(error)}") from error
    if len(files[series[0]]) == 1:
        check_frames(Path(files[series[0]][0]), image, on_warning)
    return image


def series_files(folder: Path) -> list[Path]:
    """The files that `read_series` would read, as far as that can be told without reading them.

    Raises:
        InputError: the folder cannot be read.
    """
    return [entry for entry in _entries(folder) if entry.is_file() and not entry.name.lower().endswith(NO_SLICES)]


def _warn_of_unread_files(folder: Path, files: tuple[str, ...], on_warning: Callable[[str], None]) -> None:
    """GDCM passes over a slice that was cut off; at the end of a series, nothing else tells of it."""
    read = {Path(name).name for name in files}
    unread = [entry.name for entry in _entries(folder) if entry.name not in read and _is_dicom(entry)]
    if unread:
        on_warning(f"{folder}: DICOM files without a slice that can be read: {len(unread)}, such as {unread[0]}.")


def _is_dicom(path: Path) -> bool:
    return path.is_file() and path.name != "DICOMDIR" and is_dicom_start(read_start(path, DICOM_START_BYTES))


class _SliceHeader(NamedTuple):
    """What is known of a slice without its voxels.

    Attributes:
        position: of the first pixel, (3,), LPS millimetres.
        directions: of its axes, in columns (3, 3), its normal as the last.
        size: (I, J, K); K is 1 but where a file has several frames.
        kind: of number that ITK makes of its pixels. Each slice may be scaled in a way of its own, as in PET.
    """

    position: np.ndarray
    directions: np.ndarray
    size: tuple[int, ...]
    kind: int


def _check_slices(
    files: tuple[str, ...], headers: Sequence[_SliceHeader], folder: Path, on_warning: Callable[[str], None]
) -> None:
    """Raise InputError where slices cannot be a stack; warn where they are one, but not on the grid that ITK makes of it.

    GDCM leaves slices unsorted where two have one position, and ITK takes any two slices for neighbours, straight above each
    other.
    """
    positions, directions, sizes, _ = map(np.array, zip(*headers, strict=True))
    if len(files) > 1 and (sizes[:, 2] > 1).any():
        several = Path(files[int((sizes[:, 2] > 1).argmax())]).name
        raise InputError(
            f"The DICOM series in {folder} has {len(files)} files, of which {several}, for one, has several slices of its own. "
            "Name the file to use alone."
        )
    unlike = (sizes != sizes[0]).any(axis=1)
    if unlike.any():
        one, other = (
            f"{Path(files[index]).name} with {'×'.join(map(str, sizes[index][:2]))}" for index in (0, unlike.argmax())
        )
        raise InputError(
            f"The DICOM series in {folder} has slices of different sizes, such as {one} and {other} pixels. Name a folder with "
            "slices of one size."
        )
    turned = np.abs(directions - directions[0]).max(axis=(1, 2)) > LARGEST_SPACING_DEVIATION
    if turned.any():
        raise InputError(
            f"The DICOM series in {folder} has slices that are not parallel, such as {Path(files[0]).name} and "
            f"{Path(files[int(turned.argmax())]).name}: a survey in several directions, perhaps. Name a folder with one stack."
        )
    normal = directions[0][:, 2]
    order = np.argsort(positions @ normal)
    heights = (positions @ normal)[order]
    gaps = np.diff(heights)
    if len(gaps) == 0:
        return
    closest = int(gaps.argmin())
    if gaps[closest] <= LARGEST_SPACING_DEVIATION * np.median(gaps):
        one, other = sorted(Path(files[order[index]]).name for index in (closest, closest + 1))
        raise InputError(
            f"The DICOM series in {folder} has two slices at one place: {one} and {other}. Remove the one that is a copy; of "
            "several phases or echoes, put one into a folder of its own."
        )
    if np.ptp(gaps) > LARGEST_SPACING_DEVIATION * np.median(gaps):
        on_warning(
            f"{folder}: slice distances vary from {gaps.min():.2f} to {gaps.max():.2f} mm: slices may be missing, and "
            "positions beyond them off."
        )
    shift = positions[order[-1]] - positions[order[0]] - np.sum(gaps) * normal
    shift_mm = float(np.linalg.norm(shift))
    if shift_mm > LARGEST_SPACING_DEVIATION * np.sum(gaps):
        on_warning(
            f"{folder}: the last slice is shifted against the first by {shift_mm:.1f} mm, as with a tilted gantry, and is "
            "taken for straight above it: positions are off by as much. Have the slices straightened first."
        )


def _slice_header(file_name: str) -> _SliceHeader:
    reader = sitk.ImageFileReader()
    reader.SetFileName(file_name)
    reader.ReadImageInformation()
    directions = np.array(reader.GetDirection()).reshape(3, 3)
    return _SliceHeader(np.array(reader.GetOrigin()), directions, reader.GetSize(), reader.GetPixelID())


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(entry for entry in folder.iterdir() if entry.exists())
    except OSError as error:
        raise InputError(f"Cannot read the folder {folder}: {error.strerror or error}.") from error
