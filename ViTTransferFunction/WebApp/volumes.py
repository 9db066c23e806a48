"""Volumes from files, as nodes of the scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..Logic.core.errors import InputError
from ..Logic.core.volume import Volume
from ..Logic.files.volume_files import read_volume
from ..Logic.scene.volume import set_image


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


def volume_of_files(paths: list[Path]) -> Volume:
    """The volume in some files: one image, a header with its voxels, or the slices of a DICOM series in one folder.

    Raises:
        InputError: it cannot be read.
    """
    headers = [path for path in paths if path.name.lower().endswith((".nhdr", ".mhd", ".hdr"))]
    if len(paths) == 1:
        return read_volume(paths[0])
    return read_volume(headers[0]) if len(headers) == 1 else read_volume(paths[0].parent)


def add_volume(scene: Any, volume: Volume) -> Any:
    """A node of the scene with a volume's voxels; returns it."""
    node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", volume.name)
    set_image(node, volume.array, volume.geometry.ijk_to_ras)
    node.CreateDefaultDisplayNodes()
    return node
