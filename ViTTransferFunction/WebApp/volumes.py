"""Volumes from files, as nodes of the scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..Logic.core.system.errors import InputError
from ..Logic.core.volumes.intensity_window import (
    CT_BONE,
    CT_LUNG,
    CT_SOFT_TISSUE,
    IntensityWindow,
    display_window,
    looks_like_hounsfield_units,
)
from ..Logic.core.volumes.volume import Volume
from ..Logic.files.file_start import DICOM_START_BYTES, is_dicom_start, read_start
from ..Logic.files.volume_files import read_volume
from ..Logic.scene.volumes.volume_nodes import set_image, volume_from_node

CT_WINDOWS = {"Soft tissue": CT_SOFT_TISSUE, "Lung": CT_LUNG, "Bone": CT_BONE}


def sample_path() -> Path:
    """A chest CT that comes with the Python package slicerio.

    Raises:
        InputError: the package is not installed, or came without it.
    """
    try:
        import slicerio
    except ImportError as error:
        raise InputError("The sample is part of the Python package slicerio: pip install slicerio.") from error
    path = Path(slicerio.__file__).parent / "data" / "CTChest4.nrrd"
    if not path.exists():
        raise InputError("This version of the Python package slicerio has no sample (CTChest4.nrrd); open a file of your own.")
    return path


def volume_of_files(paths: list[Path], on_warning: Callable[[str], None], series: str | None) -> Volume:
    """The volume in some files: one image, a header with its voxels, or the slices of DICOM series in one folder.

    Args:
        paths: the files, or a folder.
        on_warning: is told what was found odd, or read otherwise than it is stored; see `read_volume`.
        series: which of several DICOM series, as `choose_series` takes it.

    Raises:
        SeveralSeries: there are several that may be meant.
        InputError: it cannot be read, or there are several files that are no slices.
    """
    if len(paths) == 1:
        return read_volume(paths[0], on_warning, series)
    headers = [path for path in paths if path.name.lower().endswith((".nhdr", ".mhd", ".hdr"))]
    if len(headers) == 1:
        return read_volume(headers[0], on_warning)
    if not any(is_dicom_start(read_start(path, DICOM_START_BYTES)) for path in paths):
        raise InputError(
            f"{len(paths)} files were sent at once, such as {paths[0].name}; expected one image, a header with its voxels, or "
            "the slices of DICOM series. Send one volume at a time."
        )
    return read_volume(paths[0].parent, on_warning, series)


def add_volume(scene: Any, volume: Volume) -> Any:
    """A node of the scene with a volume's voxels; returns it."""
    node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", volume.name)
    set_image(node, _of_usable_type(volume.array), volume.geometry.ijk_to_ras)
    node.CreateDefaultDisplayNodes()
    return node


def _of_usable_type(array: np.ndarray) -> np.ndarray:
    """The same voxels: slices show no integers of eight bytes, and sessions hold neither these nor signed ones of one byte."""
    if array.dtype == np.int8:
        return array.astype(np.int16)
    if array.dtype.kind in "iu" and array.dtype.itemsize == 8:
        ends = np.iinfo(np.int32)
        return array.astype(np.int32 if ends.min <= array.min() and array.max() <= ends.max else np.float64)
    return array


def windows_of(node: Any) -> dict[str, IntensityWindow]:
    """In which intensities people look at a volume node, by what they call that; the one to begin with is the first.

    Raises:
        InputError: the node is no scalar volume.
    """
    volume = volume_from_node(node)
    return CT_WINDOWS if looks_like_hounsfield_units(volume) else {"Automatic": display_window(volume)}
