"""Public scans and what is right in them, from each form in which they are published."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813
from scipy.io import loadmat

from Benchmarks.public_scans.contours import lidc_nodules, rtstruct_mask
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import image_geometry, read_volume

Masks = Mapping[str, np.ndarray]
"""Of structures by name, each (K, J, I) bool."""


def numbered(scan: Path, labels: Path, structures: Mapping[str, tuple[int, ...]]) -> tuple[Volume, Masks]:
    """A scan and its label map, of formats that ITK reads; by name the numbers that each structure has in the map."""
    image, truth = sitk.ReadImage(str(scan)), sitk.GetArrayFromImage(sitk.ReadImage(str(labels)))
    volume = Volume(sitk.GetArrayFromImage(image), image_geometry(image))
    return volume, {name: np.isin(truth, numbers) for name, numbers in structures.items()}


def drawn_in_slices(series: Path, pictures: Path, name: str) -> tuple[Volume, Masks]:
    """A DICOM series, and of each slice a picture in which a structure is white, in the order of the files' names."""
    volume = read_volume(series)
    masks = np.array([sitk.GetArrayFromImage(sitk.ReadImage(str(path))) > 0 for path in sorted(pictures.glob("*.png"))])
    # The first file is the uppermost slice.
    return volume, {name: masks[::-1]}


def contoured(series: Path, contours: Path, structures: Mapping[str, str]) -> tuple[Volume, Masks]:
    """A DICOM series and its RTSTRUCT; by name what each structure is called there."""
    volume = read_volume(series)
    return volume, {name: rtstruct_mask(contours, called, volume.geometry) for name, called in structures.items()}


def lidc(series: Path, database: Path, patient: str) -> tuple[Volume, Masks]:
    """A scan of LIDC-IDRI, and its nodules."""
    volume = read_volume(series)
    nodules = lidc_nodules(database, patient, volume.geometry)
    names = ["nodule"] if len(nodules) == 1 else [f"nodule {number}" for number in range(1, len(nodules) + 1)]
    return volume, dict(zip(names, nodules, strict=True))


def matlab(path: Path, structure: str) -> tuple[Volume, Masks]:
    """A spine of 1 mm: rows run to the feet, columns to the back, planes to the right."""
    content = loadmat(path)
    # Planes, rows and columns are k, j and i.
    array, truth = (np.ascontiguousarray(np.moveaxis(content[key], 2, 0)) for key in ("I", "GT"))
    ijk_to_ras = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    volume = Volume(array, Geometry(array.shape, ijk_to_ras))
    return volume, {f"{structure} {number}": truth == number for number in range(1, int(truth.max()) + 1)}
