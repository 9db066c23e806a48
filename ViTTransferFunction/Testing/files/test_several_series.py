"""Folders with several DICOM series, in themselves or below: which is read, and what is said where nobody can tell."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system import regular_file
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files import dicom_folder
from ViTTransferFunction.Logic.files.series_choice import SeveralSeries
from ViTTransferFunction.Logic.files.volume_files import files_of, read_volume
from ViTTransferFunction.Testing.attack.scans import Scan, write_dicom
from ViTTransferFunction.Testing.files.test_dicom_series import (
    ASCENDING,
    SAGITTAL,
    element,
    stack,
    write_elements,
    write_frames,
)

REPORT, OUTLINES = "1.2.840.10008.5.1.4.1.1.88.67", "1.2.840.10008.5.1.4.1.1.481.3"


def write_series(folder: Path, number: str, description: str, slices: int = 4, scan: Scan | None = None, **about: str) -> None:
    """Write a series with its number as the beginning of the files' names; `about`: `date`, and `study` before its UID."""
    tags = {"0020|0011": number, "0008|103e": description, "0008|0021": about.get("date", "20240131")}
    uid = f"1.2.{about.get('study', '1')}.{number or 99}"
    for path in write_dicom(folder, scan or stack(slices), uid, 100 * int(number or 99), {**tags, "0008|0060": "MR"}):
        path.rename(path.with_name(f"{about.get('study', '')}{path.name}"))


def higher(mm: float, brighter: int = 0) -> Scan:
    """`stack()` moved upwards, with higher intensities."""
    scan = stack()
    return Scan(scan.array + brighter, scan.spacing, scan.direction, np.array([0.0, 0.0, mm]), scan.inside)


def write_two(folder: Path) -> None:
    write_series(folder, "2", "T1 axial", 3)
    write_series(folder, "12", "T2 axial", 5)


def read(folder: Path, series: str | None = None) -> tuple[Volume, list[str]]:
    warnings: list[str] = []
    return read_volume(folder, warnings.append, series), warnings


def test_series_are_listed_by_what_people_know_of_them(tmp_path: Path) -> None:
    write_two(tmp_path)
    with pytest.raises(SeveralSeries, match=r"holds 2 DICOM volumes to choose from: 2: T1 axial .*--series") as refusal:
        read_volume(tmp_path)
    assert refusal.value.lines == ("2: T1 axial (MR, 7×6×3)", "12: T2 axial (MR, 7×6×5)")
    assert "1.2.1" not in str(refusal.value)


@pytest.mark.parametrize("wanted", ["2", " 2 ", "t1", "T1 AXIAL", "7×6×3", "2: T1 axial (MR, 7×6×3)", "t1 axial"])
def test_a_series_is_chosen_by_its_number_or_a_part_of_its_line(tmp_path: Path, wanted: str) -> None:
    write_two(tmp_path)
    volume, warnings = read(tmp_path, wanted)
    assert (len(volume.array), warnings) == (3, [])


@pytest.mark.parametrize(
    ("wanted", "message"),
    [("axial", "2 DICOM volumes in .* are 'axial'"), ("3", "No DICOM series in .* is '3'; it holds 2: T1")],
)
def test_what_fits_several_series_or_none_is_refused_with_what_there_is(tmp_path: Path, wanted: str, message: str) -> None:
    write_two(tmp_path)
    with pytest.raises(SeveralSeries, match=message):
        read_volume(tmp_path, series=wanted)


def test_a_number_that_a_table_made_a_decimal_one_of_is_not_taken_for_another_series_slice_thickness(tmp_path: Path) -> None:
    write_series(tmp_path, "2", "Thorax 3.0 B31f", 3)
    write_series(tmp_path, "3", "Thorax 1.0 B70f", 5)
    assert len(read(tmp_path, "2.0")[0].array) == 3
    with pytest.raises(SeveralSeries, match=r"2 DICOM volumes in .* are '3\.0': 2: Thorax 3\.0 .*; 3: Thorax 1\.0 "):
        read_volume(tmp_path, series="3.0")
    assert len(read(tmp_path, "3.0 B31f")[0].array) == 3


def test_the_only_series_is_not_read_in_place_of_another_one_that_was_named(tmp_path: Path) -> None:
    write_series(tmp_path, "2", "T1")
    with pytest.raises(InputError, match=r"No DICOM series in .* is 'T2'"):
        read_volume(tmp_path, series="T2")


def test_a_series_of_a_file_cannot_be_named(tmp_path: Path) -> None:
    file = write_frames(tmp_path / "scan" / "1.dcm", ASCENDING)
    with pytest.raises(InputError, match="no folder of DICOM series; leave --series 'T1' out"):
        read_volume(file, series="T1")


def test_series_that_are_called_alike_are_told_apart_by_their_dates_and_as_the_last_by_their_uids(tmp_path: Path) -> None:
    for study, date in (("1", "20230131"), ("2", "20240131"), ("3", "20240131")):
        write_series(tmp_path, "2", "T1", study=study, date=date)
    with pytest.raises(SeveralSeries) as refusal:
        read_volume(tmp_path)
    line = "2: T1 (MR, 7×6×4)"
    assert refusal.value.lines == (
        f"{line} of 2023-01-31", f"{line} of 2024-01-31 1.2.2.2.2", f"{line} of 2024-01-31 1.2.3.2.2"
    )  # fmt: skip
    for wanted in refusal.value.lines:
        read(tmp_path, wanted)


@pytest.mark.parametrize("uid", ["", "1.2.3"], ids=["removed", "equal"])
@pytest.mark.parametrize("half_mm", [0.0, 1.5])
def test_series_whose_uids_were_removed_or_made_equal_are_not_mixed(tmp_path: Path, uid: str, half_mm: float) -> None:
    """As by programs that take names out; of reconstructions between each other's slices, a volume of both would be made."""
    for number, description in ((2, "Thorax"), (3, "Lung")):
        about = {"0020|000e": uid, "0020|0011": str(number), "0008|103e": description}
        write_dicom(tmp_path, higher(half_mm * number, brighter=number), first=100 * number, about=about)
    with pytest.raises(SeveralSeries) as refusal:
        read_volume(tmp_path)
    assert refusal.value.lines == ("2: Thorax (CT, 7×6×8)", "3: Lung (CT, 7×6×8)")
    np.testing.assert_array_equal(read(tmp_path, "Lung")[0].array, stack().array + 3)


@pytest.mark.parametrize("tag", ["0008|103e", "0008|0060", "0008|0021"], ids=["description", "modality", "date"])
def test_series_without_uids_and_numbers_are_told_apart_by_whatever_there_is(tmp_path: Path, tag: str) -> None:
    for first, value in ((0, "20240131"), (9, "20240201")):
        write_dicom(tmp_path, higher(1.5 * first), first=first, about={"0020|000e": "", "0020|0011": "", tag: value})
    with pytest.raises(SeveralSeries, match="2 DICOM volumes to choose from"):
        read_volume(tmp_path)


@pytest.mark.parametrize(
    ("character_set", "description", "written"),
    [
        ("ISO_IR 100", "Schädel", "Schädel".encode("latin-1")),
        ("ISO_IR 100", "Schädel", "Schädel".encode()),
        ("ISO_IR 101", "Żołądek", "Żołądek".encode("iso8859_2")),
        ("ISO_IR 144", "Таз", "Таз".encode("iso8859_5")),
        ("ISO 2022 IR 126", "Ήπαρ", "Ήπαρ".encode("iso8859_7")),
        ("ISO_IR 13", "ｶﾝｿﾞｳ", "ｶﾝｿﾞｳ".encode("shift_jis")),
        ("\\ISO 2022 IR 87", "肝臓 CT", "肝臓 CT".encode("iso2022_jp")),
        ("\\ISO 2022 IR 149", "간 CT", b"\x1b$)C" + "간 CT".encode("euc_kr")),
        ("\\ISO 2022 IR 58", "肝脏 CT", b"\x1b$)A" + "肝脏 CT".encode("gb2312")),
        ("GB18030", "肝脏", "肝脏".encode("gb18030")),
        ("ISO_IR 192", "Hüfte 肝", "Hüfte 肝".encode()),
        ("\\ISO 2022 IR 87", "Sch\xe4del", b"Sch\xe4del"),
    ],
)
def test_descriptions_may_hold_any_letters(tmp_path: Path, character_set: str, description: str, written: bytes) -> None:
    tags = element(8, 5, "CS", character_set) + element(8, 0x103E, "LO", written + b"\0")
    for number, tag in enumerate((tags, b"")):
        path = write_frames(tmp_path / f"{number}.dcm", ASCENDING)
        uid = element(0x20, 0x0E, "UI", "1.2.5")
        path.write_bytes(path.read_bytes().replace(uid, element(0x20, 0x0E, "UI", f"1.2.{number}")).replace(
            element(8, 0x60, "CS", "CT"), element(8, 0x60, "CS", "CT") + tag
        ))  # fmt: skip
    with pytest.raises(SeveralSeries) as refusal:
        read_volume(tmp_path)
    assert refusal.value.lines == ("without a name (CT, 7×6×5)", f"{description} (CT, 7×6×5)")
    read(tmp_path, description)


def test_what_is_no_volume_does_not_stand_in_the_way(tmp_path: Path) -> None:
    write_series(tmp_path, "1", "Scout", 1)
    write_series(tmp_path, "3", "Chest", 5)
    write_series(tmp_path, "4", "Survey")
    write_series(tmp_path, "4", "Survey", scan=stack(2, SAGITTAL), study="1")
    write_series(tmp_path, "5", "Dose", 1)
    write_series(tmp_path, "5", "Dose", 1, study="1")
    for name, kind in (("report", REPORT), ("outlines", OUTLINES)):
        write_elements(tmp_path / name, kind, f"1.2.9.{len(name)}")

    volume, (passed_over, no_slices) = read(tmp_path)

    assert len(volume.array) == 5
    assert "the series 3: Chest (MR, 7×6×5) is read; passed over, since they are no volumes: 1: Scout" in passed_over
    assert "4: Survey" in passed_over
    assert "5: Dose" in passed_over
    assert "no slices of a scan: 2, such as outlines, a set of outlines, of a radiotherapy." in no_slices


def test_outlines_beside_a_series_do_not_hide_that_a_slice_was_cut_off(tmp_path: Path) -> None:
    write_series(tmp_path, "3", "Chest", 5)
    last = max(tmp_path.iterdir())
    last.write_bytes(last.read_bytes()[:600])
    write_elements(tmp_path / "outlines", OUTLINES, "1.2.9.8")

    volume, (no_slices, damaged) = read(tmp_path)

    assert len(volume.array) == 4
    assert "no slices of a scan: 1, such as outlines" in no_slices
    assert f"DICOM files without a slice that can be read: 1, such as {last.name}." in damaged


def test_scouts_among_the_slices_that_were_planned_on_them_are_passed_over(tmp_path: Path) -> None:
    """As some scanners keep them, in the series of the scan."""
    scan = stack(5)
    write_series(tmp_path, "3", "Chest", scan=scan)
    about = {"0020|0011": "3", "0008|103e": "Chest", "0008|0008": "ORIGINAL\\PRIMARY\\LOCALIZER"}
    write_dicom(tmp_path, stack(2, SAGITTAL), "1.2.1.3", 900, about)

    volume, (passed_over,) = read(tmp_path)

    np.testing.assert_array_equal(volume.array, scan.array)
    assert "3: Chest (MR, 7×6×5) is read; passed over, since they are no volumes: 3: Chest, scout 900.dcm (CT, " in passed_over
    assert "scout 901.dcm" in passed_over


def test_a_stack_of_scouts_alone_is_a_volume(tmp_path: Path) -> None:
    scan = stack(5)
    write_dicom(tmp_path, scan, about={"0020|0011": "1", "0008|0008": "ORIGINAL\\PRIMARY\\LOCALIZER"})
    volume, warnings = read(tmp_path)
    np.testing.assert_array_equal(volume.array, scan.array)
    assert warnings == []


def test_where_no_series_is_a_volume_all_are_listed(tmp_path: Path) -> None:
    for number in "12":
        write_series(tmp_path, number, "Scout", 1)
    with pytest.raises(InputError, match=r"none of which has several parallel slices .* 1: Scout \(MR, 7×6×1\); 2: Scout"):
        read_volume(tmp_path)


def test_a_folder_with_reports_alone_says_so(tmp_path: Path) -> None:
    write_elements(tmp_path / "report", REPORT, "1.2.9")
    with pytest.raises(InputError, match="no DICOM file that can be read as a scan: report is a report; expected a scan"):
        read_volume(tmp_path)


def test_the_disk_that_a_patient_brings_is_read_as_its_series_folder_is(tmp_path: Path) -> None:
    (tmp_path / "DICOMDIR").write_bytes(bytes(128) + b"DICM")
    (tmp_path / "viewer.exe").write_bytes(b"MZ")
    series = tmp_path / "DICOM" / "PA0" / "ST0" / "SE1"
    write_series(tmp_path / "DICOM" / "PA0" / "ST0" / "SE0", "1", "Scout", 1)
    write_series(series, "2", "Chest")
    write_series(tmp_path / "System Volume Information", "3", "Not for users")
    write_series(tmp_path / ".Trashes", "4", "Thrown away")

    volume, (warning,) = read(tmp_path)

    expected, _ = read(series)
    np.testing.assert_array_equal(volume.array, expected.array)
    np.testing.assert_array_equal(volume.geometry.ijk_to_ras, expected.geometry.ijk_to_ras)
    assert "passed over" in warning
    assert set(files_of(tmp_path)) >= set(files_of(series))


def test_a_series_may_be_spread_over_folders_in_any_order(tmp_path: Path) -> None:
    write_dicom(tmp_path / "whole", stack(6))
    paths = write_dicom(tmp_path / "spread", stack(6))
    for number, path in enumerate(paths):
        place = tmp_path / "spread" / "ab"[number % 2] / "IM.dcm" / str(9 - number)
        place.parent.mkdir(parents=True, exist_ok=True)
        path.rename(place)
    volume, warnings = read(tmp_path / "spread")
    np.testing.assert_array_equal(volume.array, read(tmp_path / "whole")[0].array)
    assert warnings == []


def test_a_folder_with_slices_of_its_own_is_read_without_those_below(tmp_path: Path) -> None:
    write_series(tmp_path, "2", "Chest")
    write_series(tmp_path / "earlier", "3", "Chest")
    own = files_of(tmp_path)
    assert (len(read(tmp_path)[0].array), len(own), {path.parent for path in own}) == (4, 4, {tmp_path})


@pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")
def test_links_that_lead_in_a_circle_are_not_followed(tmp_path: Path) -> None:
    write_series(tmp_path / "series", "2", "Chest")
    (tmp_path / "series" / "again").symlink_to(tmp_path, target_is_directory=True)
    (tmp_path / "again").symlink_to(tmp_path, target_is_directory=True)
    assert len(files_of(tmp_path)) == len(read(tmp_path)[0].array) == 4


def test_windows_older_kind_of_link_is_not_followed_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_series(tmp_path / "series", "2", "Chest")
    write_series(tmp_path / "My Pictures", "3", "Chest")
    lstat, tag = Path.lstat, 0xA0000003

    class OfJunction:
        st_reparse_tag = tag

        def __init__(self, status: os.stat_result) -> None:
            self._status = status

        def __getattr__(self, name: str) -> Any:
            return getattr(self._status, name)

    def status_of(path: Path) -> Any:
        return OfJunction(lstat(path)) if path.name == "My Pictures" else lstat(path)

    monkeypatch.setattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", tag, raising=False)
    monkeypatch.setattr(Path, "lstat", status_of)
    assert {path.parent.name for path in files_of(tmp_path)} == {"series"}


@pytest.mark.parametrize("where", [".", "below"])
def test_what_systems_put_beside_slices_is_not_among_them(tmp_path: Path, where: str) -> None:
    write_series(tmp_path / where, "2", "Chest")
    before = files_of(tmp_path)
    for name in (".DS_Store", "Thumbs.db", "desktop.ini", *(f"._{path.name}" for path in before)):
        (before[0].parent / name).write_bytes(before[0].read_bytes())
    assert files_of(tmp_path) == before
    assert len(read(tmp_path)[0].array) == 4


def test_a_series_is_not_read_without_the_slices_whose_paths_windows_does_not_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_series(tmp_path, "2", "Chest")
    longest = max(len(str(path)) for path in files_of(tmp_path))
    last = files_of(tmp_path)[-1]
    last.rename(last.with_name(f"{last.name}1"))
    monkeypatch.setattr(regular_file, "LONGEST_ON_WINDOWS", longest)
    monkeypatch.setattr(regular_file, "_long_paths_are_enabled", lambda: False)
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(InputError, match="too long a path"):
        read(tmp_path)


def test_a_folder_with_far_too_much_below_is_refused_before_anything_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_series(tmp_path / "a" / "series", "2", "Chest")
    monkeypatch.setattr(dicom_folder, "MOST_ENTRIES", 4)
    monkeypatch.setattr(dicom_folder, "read_slice", pytest.fail)
    with pytest.raises(InputError, match=r"More than 4 files and folders lie below .* Name that\."):
        read_volume(tmp_path)
