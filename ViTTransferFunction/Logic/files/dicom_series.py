"""DICOM series: a folder's slices as one image, where they are a stack, and where each of them was taken."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.system.errors import InputError
from .dicom_folder import DicomSeries, read_content
from .dicom_frames import ORIENTATION, PIXEL_SIZE, POSITION, frame_positions, with_frame_scales
from .dicom_kind import instead_of_scan
from .dicom_slice import DicomSlice, heights, turned, warn_of_inversion
from .image_formats import DICOM_READER
from .itk_errors import last_line
from .opening_memory import require_memory_to_open
from .series_choice import choose_series
from .straightening import LARGEST_DEVIATION, warn_of_gaps
from .volumes_of_series import SAME_PLACE


def read_series(folder: Path, on_warning: Callable[[str], None], series: str | None) -> tuple[sitk.Image, np.ndarray | None]:
    """Read a DICOM series of a folder.

    Args:
        folder: with its slices, or with folders that have them.
        on_warning: is told where slices seem to be missing, or do not say how they lie; and where other series were passed
            over, since they are no volumes.
        series: which one, as `choose_series` takes it; None: the only one that can be a volume.

    Returns:
        The slices, which ITK takes for straight above each other and at equal distances, and where the first pixel of each
        was taken, (K, 3) LPS millimetres; None where its one file does not say.

    Raises:
        SeveralSeries: more than one may be meant, or the wanted one is not there.
        InputError: there is none, it cannot be read, or its slices are no stack.
    """
    content = read_content(folder)
    if not content.series:
        if content.unread:
            raise InputError(
                f"The folder {folder} holds no DICOM file that can be read as a scan: {next(iter(content.unread.values()))}"
            )
        raise InputError(
            f"The folder {folder} holds no DICOM series, nor do folders below it. Name an image file, or a folder with DICOM "
            "files."
        )
    slices = choose_series(content.series, folder, series, on_warning).slices
    _warn_of_unread_files(folder, list(content.unread), on_warning)
    _warn_of_empty_files(folder, content.empty, on_warning)
    _check_slices(slices, folder)
    warn_of_inversion(folder, slices, on_warning)
    reader = sitk.ImageSeriesReader()
    # By itself it knows no files without the 128 bytes before the letters DICM.
    reader.SetImageIO(DICOM_READER)
    reader.SetFileNames([str(each.path) for each in slices])
    kind = slices[0].kind
    if len({each.kind for each in slices}) > 1:
        # ITK makes all slices numbers of the first one's kind: fractions would be cut, and large numbers become others.
        kind = sitk.sitkFloat32
        reader.SetOutputPixelType(kind)
    require_memory_to_open(folder, sum(math.prod(each.size) for each in slices), kind)
    try:
        image = reader.Execute()
    except RuntimeError as error:
        raise InputError(f"The DICOM series in {folder} cannot be read: {last_line(error)}") from error
    if len(slices) == 1:
        image = with_frame_scales(slices[0].path, image)
        return image, frame_positions(slices[0].path, image, on_warning)
    image.SetSpacing((*slices[0].pixel_mm.tolist(), *image.GetSpacing()[2:]))
    _warn_of_unsaid(folder, slices, on_warning)
    warn_of_gaps(folder, heights(slices), [_name(each.path, folder) for each in slices], on_warning)
    return image, np.array([each.position for each in slices])


def _warn_of_unread_files(folder: Path, unread: Sequence[Path], on_warning: Callable[[str], None]) -> None:
    """A slice that was cut off is passed over; at the end of a series, nothing else tells of it.

    Outlines and reports, which lie beside most scans that were planned on or read, are told apart from it.
    """
    others = [path for path in unread if instead_of_scan(path)]
    if others:
        such_as = f"{_name(others[0], folder)}, {instead_of_scan(others[0]).partition(';')[0]}"
        on_warning(f"{folder}: DICOM files passed over, since they are no slices of a scan: {len(others)}, such as {such_as}.")
    damaged = [path for path in unread if path not in others]
    if damaged:
        first = _name(damaged[0], folder)
        on_warning(f"{folder}: DICOM files without a slice that can be read: {len(damaged)}, such as {first}.")


def _warn_of_empty_files(folder: Path, empty: Sequence[Path], on_warning: Callable[[str], None]) -> None:
    """Of a slice that was not copied but by its name; where it would be the first or last, nothing else tells of it."""
    if empty:
        on_warning(
            f"{folder}: files that are empty, or links that lead nowhere: {len(empty)}, such as {_name(empty[0], folder)}. If "
            "they were slices, what they showed is missing: copy them again."
        )


def _warn_of_unsaid(folder: Path, slices: Sequence[DicomSlice], on_warning: Callable[[str], None]) -> None:
    """Those who take names out of headers may take too much."""
    unsaid = frozenset[str]().union(*(each.unsaid for each in slices))
    if PIXEL_SIZE in unsaid:
        on_warning(
            f"{folder}: slices do not say how far apart their pixels are: 1 mm is taken, as 3D Slicer does. If that is wrong, "
            "so are all volumes and distances; export them again with their pixel spacing (0028,0030)."
        )
    if ORIENTATION in unsaid:
        on_warning(
            f"{folder}: slices do not say how they lie in the patient: they are taken for axial ones, as 3D Slicer does, and "
            "left and right may be exchanged. Check the sides, or export them again with their orientation (0020,0037)."
        )


def _check_slices(slices: Sequence[DicomSlice], folder: Path) -> None:
    """Raise InputError where slices cannot be a stack.

    Args:
        slices: sorted by their heights.
        folder: for messages.
    """
    names = [_name(each.path, folder) for each in slices]
    if instead := DicomSeries(tuple(slices)).instead:
        raise InputError(f"The DICOM series in {folder} is {instead}")
    _check_sizes(slices, names, folder)
    _check_pixels(slices, names, folder)
    oblique = turned(slices)
    if oblique.any():
        raise InputError(
            f"The DICOM series in {folder} has slices that are not parallel, such as {names[0]} and "
            f"{names[int(oblique.argmax())]}: a survey in several directions, perhaps. Name a folder with one stack."
        )
    _check_places(slices, names, folder)


def _check_sizes(slices: Sequence[DicomSlice], names: Sequence[str], folder: Path) -> None:
    """Raise InputError where slices have other numbers of rows or columns than the first."""
    sizes = np.array([each.size for each in slices])
    unlike = (sizes != sizes[0]).any(axis=1)
    if unlike.any():
        one, other = (f"{names[index]} with {'×'.join(map(str, sizes[index][:2]))}" for index in (0, unlike.argmax()))
        raise InputError(
            f"The DICOM series in {folder} has slices of different sizes, such as {one} and {other} pixels. Name a folder with "
            "slices of one size."
        )


def _check_pixels(slices: Sequence[DicomSlice], names: Sequence[str], folder: Path) -> None:
    """Raise InputError where pixels have no size, or not that of the first slice, which ITK takes for all of them."""
    pixels_mm = np.array([each.pixel_mm for each in slices])
    if not pixels_mm.all():
        raise InputError(
            f"The DICOM series in {folder} cannot be read: the pixel spacing (0028,0030) of its slices is no number. Export "
            "them again."
        )
    # How far from where they belong the last pixels would lie.
    off_mm = (np.abs(pixels_mm - pixels_mm[0]) * slices[0].size[:2]).max(axis=1)
    if off_mm.max() > LARGEST_DEVIATION * pixels_mm.min():
        one, other = (
            f"{names[index]} with {' × '.join(f'{mm:g}' for mm in pixels_mm[index])}" for index in (0, int(off_mm.argmax()))
        )
        raise InputError(
            f"The DICOM series in {folder} has slices whose pixels differ in size, such as {one} and {other} mm. Name a folder "
            "with slices of one size."
        )


def _check_places(slices: Sequence[DicomSlice], names: Sequence[str], folder: Path) -> None:
    """Raise InputError where two slices lie at one place, or do not say where."""
    gaps = np.diff(heights(slices))
    if len(gaps) == 0:
        return
    closest = int(gaps.argmin())
    if gaps[closest] > SAME_PLACE * np.median(gaps):
        return
    one, other = sorted(names[closest : closest + 2])
    if POSITION in slices[closest].unsaid | slices[closest + 1].unsaid:
        raise InputError(
            f"The DICOM series in {folder} has slices that do not say where they lie, such as {one} or {other}; expected a "
            "position (0020,0032) of each. Export them again from where they came."
        )
    raise InputError(
        f"The DICOM series in {folder} has two slices at one place: {one} and {other}. Remove the one that is a copy; of "
        "several phases or echoes, which the headers do not tell apart here, put one into a folder of its own."
    )


def _name(path: Path, folder: Path) -> str:
    """A file's name as seen from the folder."""
    return str(path.relative_to(folder))
