"""Public scans and what is right in them, from each form in which they are published."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pydicom
import SimpleITK as sitk  # noqa: N813
from pydicom.pixels import pixel_array
from scipy.io import loadmat

from Benchmarks.public_scans.contours import lidc_nodules, rtstruct_mask
from ViTTransferFunction.Logic.core.volumes.geometry import LPS_TO_RAS, Geometry, transform_points
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import image_geometry, read_volume

Masks = Mapping[str, np.ndarray]
"""Of structures by name, each (K, J, I) bool."""
Numbers = Mapping[str, tuple[int, ...]]
"""Of structures by name, the numbers that each has in a label map."""


def numbered(scan: Path, *labels: Path, structures: Numbers | tuple[Numbers, ...]) -> tuple[Volume, Masks]:
    """A scan and its label map, of formats that ITK reads; of several maps, `structures` is of each."""
    volume = _volume(scan)
    of_each = structures if isinstance(structures, tuple) else (structures,)
    return volume, {
        name: np.isin(_voxels(path, volume), numbers)
        for path, names in zip(labels, of_each, strict=True)
        for name, numbers in names.items()
    }


def level_set(scan: Path, levels: Path, name: str, rows: int) -> tuple[Volume, Masks]:
    """The first rows of a scan, and what a level set encloses there: it is negative inside."""
    whole = _volume(scan)
    inside = _voxels(levels, whole)[:, :rows] < 0
    return Volume(whole.array[:, :rows], Geometry(inside.shape, whole.geometry.ijk_to_ras)), {name: inside}


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


def segmented(series: Path, segmentation: Path, structures: tuple[str, ...]) -> tuple[Volume, Masks]:
    """A DICOM series and its SEG; the names of its segments, in their order there."""
    volume, stored = read_volume(series), pydicom.dcmread(segmentation)
    masks = {name: np.zeros(volume.shape, dtype=bool) for name in structures}
    for frame, pixels in zip(stored.PerFrameFunctionalGroupsSequence, pixel_array(stored), strict=True):
        corner_lps = np.array([frame.PlanePositionSequence[0].ImagePositionPatient], dtype=float)
        layer = round(float(volume.geometry.ras_to_ijk(transform_points(LPS_TO_RAS, corner_lps))[0, 2]))
        masks[structures[frame.SegmentIdentificationSequence[0].ReferencedSegmentNumber - 1]][layer] = pixels > 0
    return volume, masks


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


def _volume(path: Path) -> Volume:
    image = sitk.ReadImage(str(path))
    return Volume(sitk.GetArrayFromImage(image), image_geometry(image))


def _voxels(path: Path, volume: Volume) -> np.ndarray:
    """Of a file on the grid of a scan, (K, J, I); where it holds several volumes, the first."""
    voxels: np.ndarray = sitk.GetArrayFromImage(sitk.ReadImage(str(path)))
    return voxels if voxels.ndim == volume.array.ndim else voxels[0]
