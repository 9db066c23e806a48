"""Volumes from files: NIfTI, NRRD, MetaImage, or a folder with one DICOM series."""

from __future__ import annotations

import logging
import math
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813 - the name that its own documentation uses

from ..core.errors import InputError
from ..core.geometry import LPS_TO_RAS, Geometry
from ..core.regular_file import check_regular_file, is_folder
from ..core.volume import Volume
from .image_headers import DICOM_START_BYTES, image_ending, image_format, is_dicom_start, locate_voxels, read_start

logger = logging.getLogger(__name__)

LARGEST_SPACING_DEVIATION = 0.01
"""Relative deviation of slice distances above which a DICOM series is not a regular grid; and of slices from lying straight
above each other, and from being parallel."""

RESULTS = (".nrrd", ".nii", ".nii.gz", ".mha", ".json", ".png")
"""Endings of files that are no slices: results may be written, and written again, beside a DICOM series."""

SMALLEST_EXTENT_MM = 2.0
"""A whole body in metres is shorter; what is imaged at one micrometre is longer."""

LARGEST_EXTENT_MM = 1e5
"""A mouse in micrometres is about as long."""


def read_volume(path: Path, on_warning: Callable[[str], None] = logger.warning) -> Volume:
    """Read a scalar 3D volume.

    Args:
        path: an image file, or a folder that holds one DICOM series.
        on_warning: is told where slices are missing or shifted, so that positions are off.

    Raises:
        InputError: missing, unreadable, cut off, not a scalar 3D image, not lying anywhere in millimetres, or nothing to be
            seen in it (`Volume`).
    """
    image = _read_series(path, on_warning) if is_folder(path) else _read_file(path)
    geometry = _geometry(image, path)
    _check_millimetres(geometry, path)
    return Volume(_voxels(image), geometry, name=_name(path))


def read_image(path: Path) -> tuple[np.ndarray, Geometry, dict[str, str]]:
    """Read a scalar 3D image file, of label numbers say.

    Returns:
        Voxels (K, J, I), where they lie, and the header's key-value pairs.

    Raises:
        InputError: missing, unreadable, cut off, or not a scalar 3D image.
    """
    image = _read_file(path)
    tags = {key: image.GetMetaData(key) for key in image.GetMetaDataKeys()}
    return _voxels(image), _geometry(image, path), tags


def read_geometry(path: Path) -> Geometry:
    """Where the voxels of an image file lie, from its header alone. Raises InputError as `read_image` does."""
    with _header_reader(path) as reader:
        return _geometry(reader, path)


def files_of(path: Path) -> list[Path]:
    """The files that `read_volume` would read, as far as that can be told without reading them.

    Raises:
        InputError: the volume is missing, or its header cannot be used.
    """
    if is_folder(path):
        return [entry for entry in _entries(path) if entry.is_file() and not entry.name.lower().endswith(RESULTS)]
    stored = locate_voxels(path)
    return [path] if stored is None else [path, stored.path]


def image_geometry(image: sitk.Image | sitk.ImageFileReader) -> Geometry:
    """Geometry of a 3D SimpleITK image, or of the one whose header was read; further axes are passed over."""
    axes = image.GetDimension()
    directions = np.array(image.GetDirection()).reshape(axes, axes)[:3, :3]
    ijk_to_lps = np.eye(4)
    ijk_to_lps[:3, :3] = directions * np.array(image.GetSpacing()[:3])
    ijk_to_lps[:3, 3] = image.GetOrigin()[:3]
    return Geometry(image.GetSize()[2::-1], LPS_TO_RAS @ ijk_to_lps)


def _geometry(image: sitk.Image | sitk.ImageFileReader, path: Path) -> Geometry:
    try:
        return image_geometry(image)
    except ValueError as error:
        spacing = " × ".join(f"{mm:g}" for mm in image.GetSpacing())
        raise InputError(
            f"{path} does not say where it lies: its spacing is {spacing} mm, the directions of its axes "
            f"{tuple(image.GetDirection())}; expected finite numbers and three different axes. Save it again from its source."
        ) from error


def _check_millimetres(geometry: Geometry, path: Path) -> None:
    """Other units would be taken for millimetres: distances between points, and millilitres, would all be wrong."""
    longest_mm = float(geometry.extent_mm.max())
    if SMALLEST_EXTENT_MM <= longest_mm <= LARGEST_EXTENT_MM:
        return
    unit = "metres" if longest_mm < SMALLEST_EXTENT_MM else "micrometres"
    spacing = " × ".join(f"{mm:g}" for mm in geometry.spacing_mm)
    raise InputError(
        f"{path} is {longest_mm:g} mm long, with a spacing of {spacing} mm; expected {SMALLEST_EXTENT_MM:g} to "
        f"{LARGEST_EXTENT_MM:g} mm. If it was saved in {unit}, save it in millimetres."
    )


def _voxels(image: sitk.Image) -> np.ndarray:
    """The voxels (K, J, I) of an image that nobody else has: its own memory, of which a copy would take as much again."""
    return np.asarray(_Memory(image)).reshape(image.GetSize()[2::-1])


class _Memory:
    """An image's memory, as numpy takes it. The array holds on to it, and so to the image, which SimpleITK's views do not."""

    def __init__(self, image: sitk.Image) -> None:
        self._image = image
        interface = sitk.GetArrayViewFromImage(image).__array_interface__
        address, _ = interface["data"]
        self.__array_interface__ = {**interface, "data": (address, False)}


def _read_file(path: Path) -> sitk.Image:
    stored = locate_voxels(path)
    with _header_reader(path) as reader:
        _check_header(reader.GetSize(), reader.GetNumberOfComponents(), path)
        if stored is not None:
            voxel_bytes = stored.voxel_bytes or sitk.Image([1, 1, 1], reader.GetPixelID()).GetSizeOfPixelComponent()
            stored.check_complete(math.prod(reader.GetSize()) * voxel_bytes)
        return reader.Execute()


@contextmanager
def _header_reader(path: Path) -> Iterator[sitk.ImageFileReader]:
    """A reader that has read the header: what cannot be used is refused before its voxels are read."""
    reader = sitk.ImageFileReader()
    reader.SetImageIO(image_format(path).reader)
    with _under_its_own_name(path) as name:
        try:
            reader.SetFileName(str(name))
            reader.ReadImageInformation()
            yield reader
        except RuntimeError as error:
            reason = last_line(error).replace(str(name), str(path))
            if "orthonormal" in reason:
                reason = "its axes are not at right angles, as where a gantry was tilted. Resample it to a straight grid first."
            raise InputError(f"{path} cannot be read as an image: {reason}") from error


@contextmanager
def _under_its_own_name(path: Path) -> Iterator[Path]:
    """A path by which ITK reads just the file at `path`.

    Its reader of NIfTI goes by names: beside `s.nii` it takes the voxels of that for those of `s.nii.gz`, and of endings it
    knows only those that are all in one case.
    """
    ending = image_ending(path) or ""
    if ending not in (".nii", ".nii.gz") or (path.name.endswith(ending) and not _namesake(path).exists()):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="vittf-", ignore_cleanup_errors=True) as folder:
        alias = Path(folder) / f"image{ending}"
        try:
            alias.symlink_to(path.resolve())
        except OSError:  # Windows lets few users make links.
            try:
                shutil.copyfile(path, alias)
            except OSError as error:
                raise InputError(f"Cannot read {path} by way of the folder {folder}: {error.strerror or error}.") from error
        yield alias


def _namesake(path: Path) -> Path:
    """The file whose voxels ITK would take for those of a `.nii.gz` file."""
    return path.with_name(path.name[: -len(".gz")]) if path.name.endswith(".gz") else path.with_name(f"{path.name}.gz")


def _read_series(folder: Path, on_warning: Callable[[str], None]) -> sitk.Image:
    for entry in _entries(folder):
        # GDCM would open it, and wait.
        if not entry.is_dir():
            check_regular_file(entry)
    series = sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(folder))
    if not series:
        raise InputError(f"The folder {folder} holds no DICOM series. Name an image file, or a folder with DICOM files.")
    files = {uid: sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder), uid) for uid in series}
    if len(series) > 1:
        listing = "; ".join(f"{uid} ({len(names)} files)" for uid, names in files.items())
        raise InputError(
            f"The folder {folder} holds {len(series)} DICOM series: {listing}. Put the one to use in a folder of its own."
        )
    _warn_of_unread_files(folder, files[series[0]], on_warning)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(files[series[0]])
    try:
        _check_slices(files[series[0]], folder, on_warning)
        image = reader.Execute()
    except RuntimeError as error:
        raise InputError(f"The DICOM series in {folder} cannot be read: {last_line(error)}") from error
    _check_header(image.GetSize(), image.GetNumberOfComponentsPerPixel(), folder)
    return image


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(entry for entry in folder.iterdir() if entry.exists())
    except OSError as error:
        raise InputError(f"Cannot read the folder {folder}: {error.strerror or error}.") from error


def _check_header(size: Sequence[int], components: int, path: Path) -> None:
    """Raise InputError unless it is of a scalar 3D volume; one that has further axes is, if it has one frame along these."""
    if len(size) < 3 or math.prod(size[3:]) != 1 or components != 1:
        kind = f"{len(size)}D image of size {'×'.join(map(str, size))}" + (
            f" with {components} components" if components > 1 else ""
        )
        advice = (
            "Choose one channel or time point and save it alone." if len(size) > 2 else "Name the stack that it is a slice of."
        )
        raise InputError(f"{path} is a {kind}; expected a scalar 3D volume. {advice}")


def _warn_of_unread_files(folder: Path, files: tuple[str, ...], on_warning: Callable[[str], None]) -> None:
    """GDCM passes over a slice that was cut off; at the end of a series, nothing else tells of it."""
    read = {Path(name).name for name in files}
    unread = [entry.name for entry in _entries(folder) if entry.name not in read and _is_dicom(entry)]
    if unread:
        on_warning(f"{folder}: DICOM files without a slice that can be read: {len(unread)}, such as {unread[0]}.")


def _is_dicom(path: Path) -> bool:
    return path.is_file() and path.name != "DICOMDIR" and is_dicom_start(read_start(path, DICOM_START_BYTES))


def _check_slices(files: tuple[str, ...], folder: Path, on_warning: Callable[[str], None]) -> None:
    """Raise InputError where slices cannot be a stack; warn where they are one, but not on the grid that ITK makes of it.

    GDCM leaves slices unsorted where two have one position, and ITK takes any two slices for neighbours, straight above each
    other.
    """
    positions, directions, sizes = map(np.array, zip(*(_slice_place(name) for name in files), strict=True))
    unlike = (sizes != sizes[0]).any(axis=1)
    if unlike.any():
        one, other = (f"{Path(files[index]).name} with {'×'.join(map(str, sizes[index]))}" for index in (0, unlike.argmax()))
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


def _slice_place(file_name: str) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Where a slice's first pixel is (3,), LPS millimetres; its axes in columns (3, 3), its normal as the last; its size."""
    reader = sitk.ImageFileReader()
    reader.SetFileName(file_name)
    reader.ReadImageInformation()
    return np.array(reader.GetOrigin()), np.array(reader.GetDirection()).reshape(3, 3), reader.GetSize()[:2]


def _name(path: Path) -> str:
    name = path.resolve().name
    return name[: -len(".nii.gz")] if name.lower().endswith(".nii.gz") else (name if path.is_dir() else path.stem)


def last_line(error: Exception) -> str:
    """SimpleITK's own sentence, without the C++ source lines above it, and a matrix of numbers below."""
    lines = [line.strip() for line in str(error).splitlines() if re.search("[A-Za-z]", line)]
    # ITK names the object that complains, and where that is in memory.
    return re.sub(r"^ITK ERROR: \w+\(0x[0-9a-f]+\): *", "", lines[-1]) if lines else repr(error)
