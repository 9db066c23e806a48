"""Public scans are brought into the form that `bench own_scans` takes, with each structure where its readers drew it."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

pytest.importorskip("skimage")

from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import UID, ExplicitVRLittleEndian, RTStructureSetStorage, SegmentationStorage
from scipy.io import savemat

from Benchmarks.own_scans.own_scan import OwnScan
from Benchmarks.public_scans import run
from Benchmarks.public_scans.contours import lidc_nodules, rtstruct_mask
from Benchmarks.public_scans.readers import drawn_in_slices, level_set, matlab, numbered, segmented
from Benchmarks.public_scans.scans import PublicScan
from ViTTransferFunction.Logic.core.volumes.geometry import LPS_TO_RAS, Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Testing.attack.scans import Scan, write_dicom

GEOMETRY = Geometry((5, 12, 14), LPS_TO_RAS @ np.diag([2.0, 3.0, 4.0, 1.0]))
"""Of a scan whose first voxel is at the origin."""


def box(rows: slice, columns: slice, layer: int) -> np.ndarray:
    mask = np.zeros(GEOMETRY.shape, dtype=bool)
    mask[layer, rows, columns] = True
    return mask


def write_rtstruct(path: Path, name: str, contours: Sequence[np.ndarray]) -> None:
    """Write contours, each (N, 3) LPS millimetres, of one structure beside another one."""
    content = Dataset()
    content.file_meta = FileMetaDataset()
    content.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    content.SOPClassUID, content.SOPInstanceUID = RTStructureSetStorage, UID("1.2.3")
    content.StructureSetROISequence, content.ROIContourSequence = [], []
    for number, called in enumerate(("other", name), start=1):
        roi, drawn = Dataset(), Dataset()
        roi.ROINumber = drawn.ReferencedROINumber = number
        roi.ROIName = called
        drawn.ContourSequence = []
        for points in contours if called == name else ():
            contour = Dataset()
            contour.ContourData = [f"{value:g}" for value in points.ravel()]
            drawn.ContourSequence.append(contour)
        content.StructureSetROISequence.append(roi)
        content.ROIContourSequence.append(drawn)
    content.save_as(path, enforce_file_format=True)


def rectangle(left: float, right: float, front: float, back: float, height: float) -> np.ndarray:
    """A contour, (4, 3) LPS millimetres."""
    return np.array([[left, front, height], [right, front, height], [right, back, height], [left, back, height]])


def test_a_contour_in_another_one_is_a_hole_in_it(tmp_path: Path) -> None:
    outer, hole = rectangle(3, 21, 4, 25, 8), rectangle(7, 13, 10, 19, 8)
    write_rtstruct(tmp_path / "rs.dcm", "tumour", [outer, hole])
    expected = box(slice(2, 9), slice(2, 11), 2) & ~box(slice(4, 7), slice(4, 7), 2)
    assert np.array_equal(rtstruct_mask(tmp_path / "rs.dcm", "tumour", GEOMETRY), expected)


def write_lidc(path: Path, readings: Sequence[tuple[str, tuple[int, int, int, int], float]]) -> None:
    """Write what readers drew: the patient, the first and last column and row outside the nodule, and the height."""
    with sqlite3.connect(path) as database:
        database.executescript(
            "CREATE TABLE scans (id, patient_id); CREATE TABLE annotations (id, scan_id);"
            "CREATE TABLE contours (id, annotation_id, image_z_position, coords);"
        )
        for number, (patient, (left, right, top, bottom), height) in enumerate(readings):
            corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
            drawn = "\n".join(f"{column},{row}" for column, row in corners)
            database.execute("INSERT INTO scans VALUES (?, ?)", (number, patient))
            database.execute("INSERT INTO annotations VALUES (?, ?)", (number, number))
            database.execute("INSERT INTO contours VALUES (?, ?, ?, ?)", (number, number, height, drawn))


def test_a_nodule_is_where_two_readers_agree_inside_of_what_they_drew(tmp_path: Path) -> None:
    first, second, alone = (1, 8, 2, 7), (3, 10, 2, 7), (11, 13, 8, 11)
    write_lidc(tmp_path / "db", [("A", first, 8.0), ("B", alone, 8.0), ("A", second, 8.0), ("A", alone, 4.0)])
    (nodule,) = lidc_nodules(tmp_path / "db", "A", GEOMETRY)
    assert np.array_equal(nodule, box(slice(3, 7), slice(4, 8), 2))


def test_readings_that_only_a_later_one_connects_are_of_one_nodule(tmp_path: Path) -> None:
    readings = [(0, 4, 1, 5), (8, 13, 1, 5), (2, 11, 1, 5)]
    write_lidc(tmp_path / "db", [("A", reading, 0.0) for reading in readings])
    (nodule,) = lidc_nodules(tmp_path / "db", "A", GEOMETRY)
    assert np.array_equal(nodule, box(slice(2, 5), slice(3, 4), 0) | box(slice(2, 5), slice(9, 11), 0))


def test_nodules_come_in_the_order_in_which_the_first_reader_saw_them(tmp_path: Path) -> None:
    small, large = (0, 4, 0, 4), (6, 13, 0, 9)
    write_lidc(tmp_path / "db", [("A", reading, 0.0) for reading in (small, large, large, small)])
    assert [mask.sum() for mask in lidc_nodules(tmp_path / "db", "A", GEOMETRY)] == [9, 48]


def test_planes_of_a_spine_run_to_the_right_rows_to_the_feet_and_columns_to_the_back(tmp_path: Path) -> None:
    array, truth = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3), np.zeros((4, 5, 3), np.uint8)
    truth[3, 1, 2] = 2
    savemat(tmp_path / "spine.mat", {"I": array, "GT": truth})
    volume, masks = matlab(tmp_path / "spine.mat", "disc")
    assert list(masks) == ["disc 1", "disc 2"]
    (k, j, i), value = np.argwhere(masks["disc 2"])[0], array[3, 1, 2]
    assert volume.array[k, j, i] == value
    assert volume.geometry.ijk_to_ras_points(np.array([[i, j, k]], float)).tolist() == [[2.0, -1.0, -3.0]]


def test_the_first_picture_is_of_the_uppermost_slice(tmp_path: Path) -> None:
    array = np.random.default_rng(0).integers(0, 100, (3, 6, 7)).astype(np.int16)
    (tmp_path / "ct").mkdir()
    write_dicom(tmp_path / "ct", Scan(array, np.ones(3), np.eye(3), np.zeros(3), ([0] * 3, [0] * 3)))
    for index in range(3):
        picture = np.zeros((6, 7), np.uint8)
        picture[index, 2] = 255
        sitk.WriteImage(sitk.GetImageFromArray(picture), str(tmp_path / f"{index}.png"))
    volume, masks = drawn_in_slices(tmp_path / "ct", tmp_path, "liver")
    places = volume.geometry.ijk_to_ras_points(np.argwhere(masks["liver"])[:, ::-1].astype(float))
    assert places[:, 2].tolist() == [0.0, 1.0, 2.0]
    assert np.argwhere(masks["liver"])[:, 1].tolist() == [2, 1, 0]


def test_what_is_written_is_what_own_scans_reads_and_what_is_missing_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    labels = np.zeros((12, 13, 14), np.uint8)
    labels[2:10, 2:8, 2:8], labels[2:10, 2:8, 8:13] = 1, 3
    image = sitk.GetImageFromArray(np.random.default_rng(0).normal(size=labels.shape).astype(np.float32))
    sitk.WriteImage(image, str(tmp_path / "scan.mha"))
    sitk.WriteImage(sitk.GetImageFromArray(labels), str(tmp_path / "labels.mha"))
    read = partial(numbered, structures={"both": (1, 3), "bright": (3,)})
    there = PublicScan("head", ("scan.mha", "labels.mha"), read)
    gone = PublicScan("gone", ("scan.mha", "elsewhere.mha"), read)
    monkeypatch.setattr(run, "SCANS", {"few": (there, gone)})
    monkeypatch.setattr("sys.argv", ["run", "--clones", str(tmp_path), "--volumes", str(tmp_path / "out")])
    run.main()
    assert f"gone: left out, {tmp_path / 'elsewhere.mha'} is not there." in capsys.readouterr().out
    found = OwnScan("head").read(tmp_path / "out" / "few")
    assert found.names == ("both", "bright")
    assert np.array_equal(found.truth, np.where(labels == 3, 2, labels))
    assert np.array_equal(found.volume.array, sitk.GetArrayFromImage(image))


def write_image(path: Path, array: np.ndarray) -> Path:
    sitk.WriteImage(sitk.GetImageFromArray(array), str(path))
    return path


def test_of_several_label_maps_each_has_its_own_structures_and_of_volumes_in_one_the_first_counts(tmp_path: Path) -> None:
    scan = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
    organs, parts = (scan > 3).astype(np.uint8), np.stack([scan % 3, scan * 0]).astype(np.uint8)
    arrays: list[np.ndarray] = [scan, organs, parts]
    paths = [write_image(tmp_path / f"{index}.nii.gz", array) for index, array in enumerate(arrays)]
    volume, masks = numbered(*paths, structures=({"organ": (1,)}, {"part": (2,), "rest": (0, 1)}))
    assert np.array_equal(volume.array, scan)
    assert np.array_equal(masks["organ"], scan > 3)
    assert np.array_equal(masks["part"], scan % 3 == 2)
    assert np.array_equal(masks["rest"], scan % 3 < 2)


def test_a_level_set_is_negative_inside_and_of_its_scan_the_first_rows_are_kept(tmp_path: Path) -> None:
    scan = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    there, levels = write_image(tmp_path / "scan.mha", scan), write_image(tmp_path / "levels.mha", scan - 5.0)
    volume, masks = level_set(there, levels, name="aorta", rows=2)
    assert np.array_equal(volume.array, scan[:, :2])
    assert np.array_equal(masks["aorta"], scan[:, :2] < 5.0)


def test_frames_of_a_dicom_segmentation_go_to_the_slices_where_they_lie(tmp_path: Path) -> None:
    array = np.random.default_rng(0).integers(0, 100, (3, 6, 8)).astype(np.int16)
    (tmp_path / "pet").mkdir()
    write_dicom(tmp_path / "pet", Scan(array, np.ones(3), np.eye(3), np.zeros(3), ([0] * 3, [0] * 3)))
    frames = np.zeros((3, 6, 8), np.uint8)
    frames[0, 1, 2], frames[1, 3, 4], frames[2, 5, 6] = 1, 1, 1
    content = Dataset()
    content.file_meta = FileMetaDataset()
    content.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    content.SOPClassUID, content.SOPInstanceUID = SegmentationStorage, UID("1.2.4")
    content.Rows, content.Columns, content.NumberOfFrames = 6, 8, 3
    content.BitsAllocated, content.BitsStored, content.HighBit, content.PixelRepresentation = 1, 1, 0, 0
    content.SamplesPerPixel, content.PhotometricInterpretation = 1, "MONOCHROME2"
    content.PixelData = np.packbits(frames.ravel(), bitorder="little").tobytes()
    content.PerFrameFunctionalGroupsSequence = []
    for segment, height in ((1, 0.0), (1, 2.0), (2, 1.0)):
        frame, number, place = Dataset(), Dataset(), Dataset()
        number.ReferencedSegmentNumber, place.ImagePositionPatient = segment, [0.0, 0.0, height]
        frame.SegmentIdentificationSequence, frame.PlanePositionSequence = [number], [place]
        content.PerFrameFunctionalGroupsSequence.append(frame)
    content.save_as(tmp_path / "seg.dcm", enforce_file_format=True)
    volume, masks = segmented(tmp_path / "pet", tmp_path / "seg.dcm", ("tumour", "metastasis"))
    heights = {
        name: volume.geometry.ijk_to_ras_points(np.argwhere(mask)[:, ::-1].astype(float)).tolist()
        for name, mask in masks.items()
    }  # fmt: skip
    assert heights["tumour"] == [[-2.0, -1.0, 0.0], [-4.0, -3.0, 2.0]]
    assert heights["metastasis"] == [[-6.0, -5.0, 1.0]]


def test_a_tumour_is_written_over_what_comes_after_it(tmp_path: Path) -> None:
    tumour, oedema = np.zeros((12, 13, 14), bool), np.zeros((12, 13, 14), bool)
    tumour[3:6, 3:6, 3:6], oedema[2:8, 2:8, 2:8] = True, True
    scan = Volume(np.random.default_rng(0).normal(size=tumour.shape), Geometry(tumour.shape, np.eye(4)))
    run.write(PublicScan("thigh", (), lambda: (scan, {"tumour": tumour, "oedema": oedema})), tmp_path, tmp_path)
    labels, _, segments = read_segmentation(tmp_path / "thigh.seg.nrrd")
    assert [segment.name for segment in segments] == ["tumour", "oedema"]
    assert np.array_equal(labels, np.where(tumour, 1, np.where(oedema, 2, 0)))
