"""DICOM files that hold no scan, though ITK makes a volume of some: refused for what they are, passed over beside one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.itk_errors import last_line
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Testing.attack.scans import write_dicom
from ViTTransferFunction.Testing.files.test_dicom_series import (
    ASCENDING,
    ULTRASOUND,
    element,
    pixel_format,
    sequence,
    stack,
    write_elements,
    write_frames,
)

STORAGE = "1.2.840.10008.5.1.4.1.1"
SEGMENTATION = f"{STORAGE}.66.4"
MOSAIC = {"0008|0008": "ORIGINAL\\PRIMARY\\M\\ND\\MOSAIC"}
FRAME_TIME = element(0x28, 9, "AT", b"\x18\x00\x63\x10")
"""By which frames follow each other: time."""


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (SEGMENTATION, "is a segmentation; expected the scan that it is of"),
        (f"{STORAGE}.481.2", "is the dose of a radiotherapy; expected the scan that it is of"),
        (f"{STORAGE}.77.1.6", "cut into tiles; expected a scan"),
    ],
)
def test_what_itk_would_make_a_volume_of_is_refused_for_what_it_is(
    tmp_path: Path, kind: str, told: str, as_folder: bool
) -> None:
    file = write_frames(tmp_path / "scan" / "1.dcm", ASCENDING, kind=kind)
    with pytest.raises(InputError, match=told):
        read_volume(file.parent if as_folder else file)


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (f"{STORAGE}.88.67", "is a report"),
        (f"{STORAGE}.66", "is raw data of a scanner"),
        (f"{STORAGE}.66.1", "is a note about other images"),
        (f"{STORAGE}.481.3", "is a set of outlines"),
        (f"{STORAGE}.481.20", "is a part of the plan or course of a radiotherapy"),
        (f"{STORAGE}.104.1", "is a document"),
        (f"{STORAGE}.2", "it holds no pixels"),
    ],
)
def test_what_holds_no_pixels_is_refused_for_what_it_is(tmp_path: Path, kind: str, told: str, as_folder: bool) -> None:
    file = write_elements(tmp_path / "scan" / "1.dcm", kind, "1.2.3")
    with pytest.raises(InputError, match=told):
        read_volume(file.parent if as_folder else file)


def test_the_directory_of_a_disk_is_no_scan(tmp_path: Path) -> None:
    file = write_elements(tmp_path / "DICOMDIR", "1.2.840.10008.1.3.10", "1.2.3")
    with pytest.raises(InputError, match=r"is the directory of a disk \(DICOMDIR\); expected a scan. Name the folder"):
        read_volume(file)


def test_beside_a_scan_its_segmentation_is_passed_over(tmp_path: Path) -> None:
    write_dicom(tmp_path, stack(6))
    write_frames(tmp_path / "segmentation.dcm", ASCENDING, kind=SEGMENTATION)
    warnings: list[str] = []

    volume = read_volume(tmp_path, warnings.append)

    np.testing.assert_array_equal(volume.array, stack(6).array)
    assert ["passed over, since they are no volumes" in warning for warning in warnings] == [True]


@pytest.mark.parametrize("placed", [False, True])
@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("TOMO", "is a set of pictures of a gamma camera"),
        ("WHOLE BODY", "is a set of pictures of a gamma camera"),
        ("RECON GATED TOMO", "is several volumes of a heartbeat, one after the other; expected one"),
    ],
)
def test_what_a_gamma_camera_took_is_no_scan_before_it_is_reconstructed(
    tmp_path: Path, kind: str, told: str, placed: bool
) -> None:
    file = gamma_camera(tmp_path / "nm" / "1.dcm", kind, placed)
    for path in (file, file.parent):
        with pytest.raises(InputError, match=told):
            read_volume(path)
    write_dicom(file.parent, stack(6))
    warnings: list[str] = []
    np.testing.assert_array_equal(read_volume(file.parent, warnings.append).array, stack(6).array)
    assert ["passed over, since they are no" in warning for warning in warnings] == [True]


def test_what_was_reconstructed_of_a_gamma_camera_is_a_scan(tmp_path: Path) -> None:
    assert read_volume(gamma_camera(tmp_path / "1.dcm", "RECON TOMO", placed=True)).shape == (5, 6, 7)


def gamma_camera(path: Path, kind: str, placed: bool) -> Path:
    """Write five frames of this kind; ITK reads those that are placed."""
    about = element(8, 8, "CS", f"ORIGINAL\\PRIMARY\\{kind}\\EMISSION")
    place = element(0x20, 0x32, "DS", "0\\0\\0") + element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0")
    detector = sequence(0x54, 0x22, place if placed else b"")
    pixels = element(0x7FE0, 0x10, "OW", np.arange(5 * 42, dtype="<i2").tobytes())
    elements = pixel_format(5), detector, pixels
    return write_elements(path, f"{STORAGE}.20", "1.2.3", *elements, about=about)


@pytest.mark.parametrize("as_folder", [False, True])
def test_a_film_is_no_stack_of_slices(tmp_path: Path, as_folder: bool) -> None:
    """ITK takes the milliseconds from one picture to the next for the millimetres between them."""
    file = in_time(write_frames(tmp_path / "scan" / "1.dcm", ASCENDING, kind=ULTRASOUND, placed=False))
    file.write_bytes(file.read_bytes().replace(element(8, 0x60, "CS", "CT"), element(8, 0x60, "CS", "US")))
    with pytest.raises(InputError, match="is a film, whose pictures follow each other in time; expected a scan"):
        read_volume(file.parent if as_folder else file)


def test_slices_of_a_ct_may_follow_each_other_in_time(tmp_path: Path) -> None:
    file = in_time(write_frames(tmp_path / "1.dcm", ASCENDING))
    assert read_volume(file).array[:, 3, 3].tolist() == [10 * height for height in ASCENDING]


def in_time(file: Path) -> Path:
    """Have the frames of a file of `write_frames` follow each other in time."""
    count = element(0x28, 8, "IS", "5")
    file.write_bytes(file.read_bytes().replace(count, count + FRAME_TIME))
    return file


def test_mosaics_are_no_stack_of_slices_wherever_they_lie(tmp_path: Path) -> None:
    paths = write_dicom(tmp_path, stack(), about=MOSAIC)
    for path in (tmp_path, paths[0]):
        with pytest.raises(InputError, match="mosaics, pictures with all slices of a volume side by side; expected"):
            read_volume(path)


def test_where_all_series_are_of_mosaics_it_is_said_so(tmp_path: Path) -> None:
    for number in (1, 2):
        write_dicom(tmp_path, stack(), f"1.2.{number}", 100 * number, {**MOSAIC, "0020|0011": str(number)})
    with pytest.raises(InputError, match=r"holds 2 DICOM series, none .* The series 1 \(CT, 7×6×8\) is of mosaics"):
        read_volume(tmp_path)


def test_dicom_is_known_by_its_content_whatever_it_is_called(tmp_path: Path) -> None:
    file = write_frames(tmp_path / "011-0001.img", ASCENDING)
    assert read_volume(file).array[:, 3, 3].tolist() == [10 * height for height in ASCENDING]


@pytest.mark.parametrize("address", ["0x5633f3821b90", "00007F7CE1C2E600"], ids=["elsewhere", "on Windows"])
@pytest.mark.parametrize(
    "complaint",
    [
        "Cannot read requested file",
        "Failed to get the buffer!",
        "Failed to change to Implicit Transfer Syntax",
        "An invalid logic behavior occurredb1 && cosines.size() == 6",
    ],
)
def test_what_gdcm_says_of_pixels_that_it_cannot_decode_is_said_in_words_for_users(complaint: str, address: str) -> None:
    error = RuntimeError(f"itkGDCMImageIO.cxx:468:\nITK ERROR: GDCMImageIO({address}): {complaint}")
    told = last_line(error)
    assert told.startswith("it holds no pixels, or they are damaged, or compressed in a way that is not known.")
    assert told.endswith("export it without compression.")
