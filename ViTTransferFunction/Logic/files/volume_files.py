"""Volumes from files: NIfTI, NRRD, MetaImage, or a folder with DICOM series."""

from __future__ import annotations

import logging
import math
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813 - the name that its own documentation uses

from ..core.system.errors import InputError, shown
from ..core.system.private_folder import private_folder
from ..core.system.regular_file import is_folder
from ..core.volumes.geometry import LPS_TO_RAS, Geometry, transform_points
from ..core.volumes.volume import Volume
from .dicom_folder import series_files
from .dicom_frames import frame_positions, with_frame_scales
from .dicom_series import read_series
from .dicom_slice import check_may_be_scan
from .file_start import read_start
from .image_formats import (
    DICOM_READER,
    NIFTI_READER,
    SEGMENTATION_ENDING,
    image_ending,
    image_format,
    locate_voxels,
    named_voxels,
    says_sides,
    says_spacing,
)
from .itk_errors import last_line
from .label_map_check import LABEL_INTENT, looks_like_labels
from .nifti_place import warn_of_place
from .opening_memory import pixel_bytes, require_memory_to_open
from .straightening import straightened

logger = logging.getLogger(__name__)

SMALLEST_EXTENT_MM = 0.05
"""No body is so short in metres, nor what is imaged by X-rays in millimetres."""
LIKELY_EXTENT_MM = 2.0
"""A whole body in metres is shorter, and so is what is imaged at voxels of less than a micrometre."""

LARGEST_EXTENT_MM = 1e5
"""A mouse in micrometres is about as long."""

UNNAMED = "volume"
"""What a volume is called that has no name."""

_NRRD_AXES = re.compile(r"number of domain axes in the NRRD file \((\d+)\)")
"""In ITK's words where they are not as many as a header's directions in space have numbers."""

_NO_SPACING = re.compile(r"Refusing to change spacing from .* to \[([^]]*)\]|axis \d+ spacing \((\S*)\) invalid")
"""In ITK's and in Teem's words."""

_NIFTI_COPIES = 2
"""Of the voxels, while ITK reads them: its reader's and the image's. Those of other formats are read into the image."""

_SEGMENT = re.compile(rb"^Segment0_\w+:=", re.MULTILINE)
"""In headers of Slicer's segmentations, whatever they are called."""


def read_volume(path: Path, on_warning: Callable[[str], None] = logger.warning, series: str | None = None) -> Volume:
    """Read a scalar 3D volume.

    Slices that are shifted against each other are put on a straight grid, as are those of DICOM at uneven distances
    (`straightened`).

    Args:
        path: an image file, or a folder that holds a DICOM series, itself or in folders below.
        on_warning: is told where slices were put on a straight grid, and where some seem to be missing; which other series and
            files of the folder were passed over, since they are no volumes; where a header does not say how far apart voxels
            are or how they lie, or other programs read it otherwise (`warn_of_place`); where intensities were inverted; where
            an image may be in metres; and where it looks like a map of labels.
        series: which of the folder's series, as `choose_series` takes it; None: the only one that can be a volume.

    Raises:
        SeveralSeries: more than one of the folder's series may be meant, or the wanted one is not there.
        InputError: missing, unreadable, cut off, not a scalar 3D image, a segmentation of Slicer's, not lying anywhere in
            millimetres, or nothing to be seen in it (`Volume`).
    """
    if series is not None and not is_folder(path):
        raise InputError(f"{path} is no folder of DICOM series; leave --series {shown(series)} out, or name the folder.")
    if not is_folder(path):
        _check_no_segmentation(path)
    # Slices of DICOM say themselves where they lie, and what they are.
    reader = DICOM_READER if is_folder(path) else image_format(path).reader
    is_dicom = reader == DICOM_READER
    image, positions = _read_dicom(path, on_warning, series) if is_dicom else (_read_file(path), None)
    geometry = _geometry(image, path)
    # ITK keeps what a NIfTI header said when it writes another format, although the image may have been moved or cropped since.
    if reader == NIFTI_READER:
        warn_of_place(path, image, geometry, on_warning)
    if not is_dicom and not says_spacing(path):
        on_warning(
            f"{path.name} does not say how far apart its voxels are: 1 mm is taken, as 3D Slicer does. If that is wrong, "
            "so are all volumes and distances; save it again with its spacing."
        )
    if not is_dicom and not says_sides(path):
        on_warning(
            f"{path.name} does not say how it lies in the patient: its first axis is taken for the one to the left, the second "
            "for the one to the back, and the third for the one to the head, as 3D Slicer does. Left and right may be "
            "exchanged: check the sides, or save it again from its source."
        )
    _check_millimetres(geometry, path, on_warning)
    array = _voxels(image)
    if not is_folder(path) and (stored := locate_voxels(path)):
        stored.restore_not_finite(array)
    if not is_dicom and (_says_labels(image) or looks_like_labels(array)):
        on_warning(
            f"{path.name} looks like a map of labels, few whole numbers in even regions. If it is one, open the scan that it "
            "is of: what is found in it would mean nothing."
        )
    if positions is None:
        positions = geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(len(array))]))
    array, geometry = straightened(path, array, geometry, positions, on_warning)
    return Volume(array, geometry, name=_name(path))


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
    locate_voxels(path)  # Refuses headers that ITK crashes on.
    with _header_reader(path) as reader:
        return _geometry(reader, path)


def files_of(path: Path) -> list[Path]:
    """The files that `read_volume` would read, as far as that can be told without reading them.

    Raises:
        InputError: the volume is missing, or its header cannot be used.
    """
    if is_folder(path):
        return series_files(path)
    stored, header = locate_voxels(path), image_format(path).header(path)
    if stored is not None:
        return [header, stored.path]
    # Where in the file its reader alone knows.
    named = named_voxels(path)
    return [header] if named is None else [header, path.parent / named]


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


def _check_no_segmentation(path: Path) -> None:
    """The numbers of segments would be taken for intensities: everything runs, and nothing of it means anything."""
    start = read_start(path)
    end = start.find(b"\n\n")  # None where the voxels are in another file.
    if start.startswith(b"NRRD") and _SEGMENT.search(start, 0, len(start) if end < 0 else end):
        raise InputError(
            f"{path} is a segmentation; expected the scan that it is of. Open the file that the scan was read from."
        )


def _says_labels(image: sitk.Image) -> bool:
    return image.HasMetaDataKey("intent_code") and image.GetMetaData("intent_code") == LABEL_INTENT


def _check_millimetres(geometry: Geometry, path: Path, on_warning: Callable[[str], None]) -> None:
    """Other units would be taken for millimetres: distances between points, and millilitres, would all be wrong."""
    longest_mm = float(geometry.extent_mm.max())
    if LIKELY_EXTENT_MM <= longest_mm <= LARGEST_EXTENT_MM:
        return
    spacing = " × ".join(f"{mm:g}" for mm in geometry.spacing_mm)
    if SMALLEST_EXTENT_MM <= longest_mm < LIKELY_EXTENT_MM:
        on_warning(
            f"{path.name} is {longest_mm:.3g} mm long, with a spacing of {spacing} mm. If it was saved in metres, all volumes "
            "and distances are wrong: save it in millimetres."
        )
        return
    unit = "metres" if longest_mm < SMALLEST_EXTENT_MM else "micrometres"
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
        voxels, pixel_id = math.prod(reader.GetSize()), reader.GetPixelID()
        if stored is not None:
            stored.check_complete(voxels * (stored.voxel_bytes or pixel_bytes(pixel_id)))
        copies = _NIFTI_COPIES if image_format(path).reader == NIFTI_READER else 1
        require_memory_to_open(path, voxels, pixel_id, copies)
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
            reason = _in_words(error).replace(str(name), str(path))
            raise InputError(f"{path} cannot be read as an image: {reason}") from error


def _in_words(error: RuntimeError) -> str:
    """What SimpleITK complains of, and what to do about it where that is known."""
    reason = last_line(error)
    if "orthonormal" in reason:
        return (
            "its axes are not at right angles, as where a gantry was tilted. Name the folder with the DICOM files instead, "
            "whose slices are straightened, or resample it to a straight grid."
        )
    if "determinant is 0" in str(error):
        return "two of its axes have one direction, or one has none. Save it again from its source."
    if spacing := _NO_SPACING.search(reason):
        return f"its spacing is {spacing[1] or spacing[2]} mm; expected numbers above 0. Save it again from its source."
    if axes := _NRRD_AXES.search(reason):
        return f"its header has {axes[1]} axes of space or time; expected the 3 of space. {_alone(int(axes[1]))}"
    return reason


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
    with private_folder() as folder:
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


def _read_dicom(path: Path, on_warning: Callable[[str], None], series: str | None) -> tuple[sitk.Image, np.ndarray | None]:
    """A folder's series, or a file, and where the first pixel of each slice lies, (K, 3) RAS millimetres, as far as it says."""
    if is_folder(path):
        image, positions = read_series(path, on_warning, series)
        _check_header(image.GetSize(), image.GetNumberOfComponentsPerPixel(), path)
    else:
        check_may_be_scan(path, on_warning)
        image = with_frame_scales(path, _read_file(path))
        positions = frame_positions(path, image, on_warning)
    return image, None if positions is None else transform_points(LPS_TO_RAS, positions)


def _check_header(size: Sequence[int], components: int, path: Path) -> None:
    """Raise InputError unless it is of a scalar 3D volume; one that has further axes is, if it has one frame along these."""
    if components > 1 and path.name.lower().endswith(SEGMENTATION_ENDING):
        raise InputError(
            f"{path} has its segments in {components} layers, as Slicer keeps those that overlap; expected one layer. In "
            "Slicer's module Segmentations, open 'Binary labelmap layers', choose 'Force collapse to single layer', press "
            "'Collapse labelmap layers', and save it again."
        )
    if len(size) < 3 or math.prod(size[3:]) != 1 or components != 1:
        kind = f"{len(size)}D image of size {'×'.join(map(str, size))}" + (
            f" with {components} components" if components > 1 else ""
        )
        raise InputError(f"{path} is a {kind}; expected a scalar 3D volume. {_alone(len(size))}")


def _alone(axes: int) -> str:
    """What to do with an image of so many axes."""
    return "Choose one channel or time point and save it alone." if axes > 2 else "Name the stack that it is a slice of."


def _name(path: Path) -> str:
    # What lies at the top of a disk, as on a patient's, has no name.
    name = path.resolve().name or UNNAMED
    return name[: -len(".nii.gz")] if name.lower().endswith(".nii.gz") else (name if path.is_dir() else path.stem)
