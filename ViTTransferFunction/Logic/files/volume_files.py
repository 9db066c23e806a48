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
"""Shorter images are refused: neither a body in metres nor an X-ray specimen in millimetres is so short."""
LIKELY_EXTENT_MM = 2.0
"""Shorter images get a warning: they may be a body in metres, or a specimen with voxels of less than a micrometre."""

LIKELY_LONGEST_MM = 3000.0
"""Longer images get a warning: no patient is so long, and a tooth in micrometres may be."""
LARGEST_EXTENT_MM = 1e5
"""Longer images are refused: this is about the length of a mouse in micrometres."""

UNNAMED = "volume"
"""Name of a volume without a name."""

_NRRD_AXES = re.compile(r"number of domain axes in the NRRD file \((\d+)\)")
"""ITK's message if the number of axes does not match the length of their direction vectors."""

_NIFTI_COPIES = 2
"""Copies of the voxels in memory while ITK reads NIfTI: the reader's and the image's. Other formats need only the image's."""

_SEGMENT = re.compile(rb"^Segment0_\w+:=", re.MULTILINE)
"""Occurs in the headers of Slicer's segmentations, whatever their file names."""


def read_volume(path: Path, on_warning: Callable[[str], None] = logger.warning, series: str | None = None) -> Volume:
    """Read a scalar 3D volume.

    Slices that are shifted against each other, and DICOM slices at uneven distances, are resampled to a straight grid
    (`straightened`).

    Args:
        path: an image file, or a folder that contains a DICOM series, also in subfolders.
        on_warning: called with a message for each of these: slices were resampled, or seem to be missing; other series and
            files of the folder were skipped, since they are not volumes; a header does not give spacing or orientation, or
            other programs read it differently (`warn_of_place`); intensities were inverted; the image may be in metres or
            micrometres; it looks like a label map.
        series: the series to read, in the form that `choose_series` takes; None: the only one that can be a volume.

    Raises:
        SeveralSeries: several of the folder's series can be volumes, or the given one does not exist.
        InputError: the image is missing, unreadable, truncated, not scalar and 3D, a Slicer segmentation, has no valid geometry
            in millimetres, or cannot be a `Volume`.
    """
    if series is not None and not is_folder(path):
        raise InputError(f"{path} is no folder of DICOM series; leave --series {shown(series)} out, or name the folder.")
    if not is_folder(path):
        _check_no_segmentation(path)
    # DICOM slices contain their position and kind, so that the checks below are for other formats.
    reader = DICOM_READER if is_folder(path) else image_format(path).reader
    is_dicom = reader == DICOM_READER
    image, positions = _read_dicom(path, on_warning, series) if is_dicom else (_read_file(path), None)
    geometry = _geometry(image, path)
    # Only for NIfTI files: ITK keeps NIfTI fields in other formats, although the image may have been moved or cropped since.
    if reader == NIFTI_READER:
        warn_of_place(path, image, geometry, on_warning)
    if not is_dicom:
        _warn_of_assumed_place(path, on_warning)
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
    """Read a scalar 3D image file, such as a label map.

    Returns:
        Voxels (K, J, I), their geometry, and the header's key-value pairs.

    Raises:
        InputError: the file is missing, unreadable, truncated, or not a scalar 3D image.
    """
    image = _read_file(path)
    tags = {key: image.GetMetaData(key) for key in image.GetMetaDataKeys()}
    return _voxels(image), _geometry(image, path), tags


def read_geometry(path: Path) -> Geometry:
    """Geometry of an image file, from its header only. Raises InputError as `read_image` does."""
    locate_voxels(path)  # Refuses headers that ITK crashes on.
    with _header_reader(path) as reader:
        return _geometry(reader, path)


def files_of(path: Path) -> list[Path]:
    """The files that `read_volume` would read, judging without reading them completely.

    Raises:
        InputError: the volume is missing, or its header cannot be used.
    """
    if is_folder(path):
        return series_files(path)
    stored, header = locate_voxels(path), image_format(path).header(path)
    if stored is not None:
        return [header, stored.path]
    # Only the format's reader knows where the voxels begin in the file.
    named = named_voxels(path)
    return [header] if named is None else [header, path.parent / named]


def image_geometry(image: sitk.Image | sitk.ImageFileReader) -> Geometry:
    """Geometry of a 3D SimpleITK image, or of a reader that has read the header; further axes are ignored."""
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
    """Refuse Slicer segmentations: their labels would be taken for intensities, and all results would be meaningless."""
    start = read_start(path)
    end = start.find(b"\n\n")  # -1 if the voxels are in another file.
    if start.startswith(b"NRRD") and _SEGMENT.search(start, 0, len(start) if end < 0 else end):
        raise InputError(
            f"{path} is a segmentation; expected the scan that it is of. Open the file that the scan was read from."
        )


def _warn_of_assumed_place(path: Path, on_warning: Callable[[str], None]) -> None:
    """Warn if a header does not give spacing or orientation."""
    if not says_spacing(path):
        on_warning(
            f"{path.name} does not say how far apart its voxels are: 1 mm is taken, as 3D Slicer does. If that is wrong, "
            "so are all volumes and distances; save it again with its spacing."
        )
    if not says_sides(path):
        on_warning(
            f"{path.name} does not say how it lies in the patient: its first axis is taken for the one to the left, the second "
            "for the one to the back, and the third for the one to the head, as 3D Slicer does. Left and right may be "
            "exchanged: check the sides, or save it again from its source."
        )


def _says_labels(image: sitk.Image) -> bool:
    return image.HasMetaDataKey("intent_code") and image.GetMetaData("intent_code") == LABEL_INTENT


def _check_millimetres(geometry: Geometry, path: Path, on_warning: Callable[[str], None]) -> None:
    """Refuse or warn of images in other units than millimetres: distances and volumes would all be wrong."""
    longest_mm = float(geometry.extent_mm.max())
    if LIKELY_EXTENT_MM <= longest_mm <= LIKELY_LONGEST_MM:
        return
    spacing = " × ".join(f"{mm:g}" for mm in geometry.spacing_mm)
    unit = "metres" if longest_mm < LIKELY_EXTENT_MM else "micrometres"
    if SMALLEST_EXTENT_MM <= longest_mm <= LARGEST_EXTENT_MM:
        on_warning(
            f"{path.name} is {longest_mm:g} mm long, with a spacing of {spacing} mm. If it was saved in {unit}, all volumes "
            "and distances are wrong: save it in millimetres."
        )
        return
    raise InputError(
        f"{path} is {longest_mm:g} mm long, with a spacing of {spacing} mm; expected {SMALLEST_EXTENT_MM:g} to "
        f"{LARGEST_EXTENT_MM:g} mm. If it was saved in {unit}, save it in millimetres."
    )


def _voxels(image: sitk.Image) -> np.ndarray:
    """The voxels (K, J, I) of an image that is not used elsewhere: its own memory, since a copy would need as much again."""
    return np.asarray(_Memory(image)).reshape(image.GetSize()[2::-1])


class _Memory:
    """An image's memory for NumPy. The array keeps it, and so the image, alive; SimpleITK's own views do not."""

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
    """A reader that has read the header, so that unusable files are refused before their voxels are read."""
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
    """SimpleITK's error message, or for known ones a clearer message that says what to do."""
    reason = last_line(error)
    if "orthonormal" in reason:
        return (
            "its axes are not at right angles, as where a gantry was tilted. Name the folder with the DICOM files instead, "
            "whose slices are straightened, or resample it to a straight grid."
        )
    if "determinant is 0" in str(error):
        return "two of its axes have one direction, or one has none. Save it again from its source."
    if axes := _NRRD_AXES.search(reason):
        return f"its header has {axes[1]} axes of space or time; expected the 3 of space. {_alone(int(axes[1]))}"
    return reason


@contextmanager
def _under_its_own_name(path: Path) -> Iterator[Path]:
    """A path by which ITK reads exactly the file at `path`.

    ITK's NIfTI reader goes by names: if there is a file `s.nii`, it reads that file's voxels for `s.nii.gz`, and it does not
    recognise endings in mixed case.
    """
    ending = image_ending(path) or ""
    if ending not in (".nii", ".nii.gz") or (path.name.endswith(ending) and not _namesake(path).exists()):
        yield path
        return
    with private_folder() as folder:
        alias = Path(folder) / f"image{ending}"
        try:
            alias.symlink_to(path.resolve())
        except OSError:  # On Windows, few users may create links.
            try:
                shutil.copyfile(path, alias)
            except OSError as error:
                raise InputError(f"Cannot read {path} by way of the folder {folder}: {error.strerror or error}.") from error
        yield alias


def _namesake(path: Path) -> Path:
    """The file of the same name with or without `.gz`, which ITK might read instead."""
    return path.with_name(path.name[: -len(".gz")]) if path.name.endswith(".gz") else path.with_name(f"{path.name}.gz")


def _read_dicom(path: Path, on_warning: Callable[[str], None], series: str | None) -> tuple[sitk.Image, np.ndarray | None]:
    """The image of a folder's series or a DICOM file, and positions of its slices' first pixels, (K, 3) RAS mm, if known."""
    if is_folder(path):
        image, positions = read_series(path, on_warning, series)
        _check_header(image.GetSize(), image.GetNumberOfComponentsPerPixel(), path)
    else:
        check_may_be_scan(path, on_warning)
        image = with_frame_scales(path, _read_file(path))
        positions = frame_positions(path, image, on_warning)
    return image, None if positions is None else transform_points(LPS_TO_RAS, positions)


def _check_header(size: Sequence[int], components: int, path: Path) -> None:
    """Raise InputError unless a header is of a scalar 3D volume; further axes are allowed if their length is 1."""
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
    """Advice for an image with this number of axes."""
    return "Choose one channel or time point and save it alone." if axes > 2 else "Name the stack that it is a slice of."


def _name(path: Path) -> str:
    # The root folder of a disk, such as a patient's CD, has no name.
    name = path.resolve().name or UNNAMED
    return name[: -len(".nii.gz")] if name.lower().endswith(".nii.gz") else (name if path.is_dir() else path.stem)
