"""Which cases a table or a folder has."""

from __future__ import annotations

from pathlib import Path

import pytest

from ViTTransferFunction.CommandLine.cohort.cases import name_problem, read_cases, told_name
from ViTTransferFunction.Logic.core.system.errors import InputError

HEADING = "case,volume,annotations"


def table(folder: Path, *lines: str) -> Path:
    path = folder / "cases.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def test_paths_of_a_table_begin_at_its_folder_and_absolute_ones_stay(tmp_path: Path) -> None:
    path = table(tmp_path, HEADING, "a,scans/a.nii.gz,points/a.json", "", f"b,{tmp_path / 'b.mha'},b.json")

    first, second = read_cases(path)

    assert (first.name, first.volume, first.annotations) == ("a", tmp_path / "scans/a.nii.gz", tmp_path / "points/a.json")
    assert second.volume == tmp_path / "b.mha"


def test_a_table_may_have_paths_in_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home"
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USERPROFILE", str(home))
    (case,) = read_cases(table(tmp_path, HEADING, "a,~/scans/a.nii.gz,~/a.json"))
    assert (case.volume, case.annotations) == (home / "scans/a.nii.gz", home / "a.json")


def test_columns_may_come_in_any_order_among_others_with_semicolons_and_as_a_spreadsheet_writes_them(tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    path.write_text("annotations;age;case;volume\r\na.json;71;Möller 1;a.nrrd\r\n", encoding="utf-8-sig")

    (case,) = read_cases(path)

    assert (case.name, case.volume.name, case.annotations.name) == ("Möller 1", "a.nrrd", "a.json")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_table_is_read_whatever_a_spreadsheet_separates_by(tmp_path: Path, encoding: str, separator: str) -> None:
    path = tmp_path / "cases.csv"
    lines = ("case", "volume", "annotations"), ("Möller, 1; 肝".replace(separator, ""), "a b.nrrd", "a.json")
    path.write_text("\r\n".join(map(separator.join, lines)), encoding=encoding)
    (case,) = read_cases(path)
    assert (case.name, case.volume.name, case.annotations.name) == (lines[1][0], "a b.nrrd", "a.json")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("above", ["sep={}", '"sep={}"', "", "{0}{0}"])
def test_a_line_for_excel_and_empty_ones_may_come_before_the_heading(tmp_path: Path, above: str, separator: str) -> None:
    path = tmp_path / "cases.csv"
    lines = [line.replace(",", separator) for line in (HEADING, "a,a.nrrd,a.json", "b")]
    path.write_text("\r\n".join([above.format(separator), *lines[:2]]), encoding="utf-8-sig")
    (case,) = read_cases(path)
    assert (case.name, case.volume.name, case.annotations.name) == ("a", "a.nrrd", "a.json")
    path.write_text("\r\n".join([above.format(separator), *lines]), encoding="utf-8-sig")
    with pytest.raises(InputError, match="line 4"):
        read_cases(path)


@pytest.mark.parametrize("above", ["", "sep=;\n"])
def test_columns_are_separated_as_in_the_heading_whatever_names_hold(tmp_path: Path, above: str) -> None:
    path = tmp_path / "cases.csv"
    path.write_text(f"{above}case;volume;annotations\n1,2,3,4;a,b,c.nrrd;a,b.json", encoding="utf-8")
    (case,) = read_cases(path)
    assert (case.name, case.volume.name, case.annotations.name) == ("1,2,3,4", "a,b,c.nrrd", "a,b.json")


def test_of_a_table_that_is_not_there_the_path_is_to_be_checked(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"There is no file .*cases\.csv\. Check the path"):
        read_cases(tmp_path / "cases.csv")


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16"])
def test_a_table_in_letters_that_differ_from_system_to_system_is_refused_with_what_to_do(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "cases.csv"
    path.write_text(f"{HEADING}\nMöller,a.nrrd,a.json", encoding=encoding)
    with pytest.raises(InputError, match="save the table as 'CSV UTF-8'"):
        read_cases(path)


@pytest.mark.parametrize("name", ["scan.nii.gz", "scan.annotations.json"])
def test_a_volume_or_points_in_place_of_a_table_are_refused_with_what_takes_them(tmp_path: Path, name: str) -> None:
    touch(tmp_path, name)
    with pytest.raises(InputError, match=r"is no table, by its ending.*`vittf segment`"):
        read_cases(tmp_path / name)


def test_a_table_may_say_which_series_of_a_folder_is_meant(tmp_path: Path) -> None:
    cases = read_cases(table(tmp_path, HEADING + ",series", "a,disk,a.json, T1 axial ", "b,disk,b.json,", "c,c.nrrd,c.json"))
    assert [case.series for case in cases] == ["T1 axial", None, None]


def test_headings_may_have_capitals_and_spaces(tmp_path: Path) -> None:
    (case,) = read_cases(table(tmp_path, "Case , VOLUME,Annotations,Series ", "a,a.nrrd,a.json,T1"))
    assert (case.name, case.volume.name, case.series) == ("a", "a.nrrd", "T1")


def test_lines_that_were_emptied_in_a_spreadsheet_are_passed_over(tmp_path: Path) -> None:
    (case,) = read_cases(table(tmp_path, HEADING, ",,", "a,a.nrrd,a.json", ",,,,"))
    assert case.name == "a"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["case,volume", "a,a.nrrd"], "no column 'annotations'"),
        ([HEADING + ",age,Volume", "a,a.nrrd,a.json,63,1.5"], "several columns called 'volume', with capitals or without"),
        ([HEADING], "has no cases"),
        ([], "no column 'case'"),
        ([HEADING, "a,a.nrrd,"], "line 2"),
        ([HEADING, "a,a.nrrd,a.json", "b"], "line 3"),
        ([HEADING, "a,a\0.nrrd,a.json"], "line 2"),
        ([HEADING + ",remark", 'a,a.nrrd,a.json,"large', "b,b.nrrd,b.json,small"], "line 2.*quotation mark"),
        ([HEADING + ",remark", 'a,a.nrrd,a.json,"large', *["b,b.nrrd,b.json," + 99 * "x"] * 2000], "quotation mark"),
    ],
)
def test_a_table_that_lacks_something_is_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_cases(table(tmp_path, *lines))


@pytest.mark.parametrize(
    "name",
    ["../a", "..", ".a", "a/b", "a\\b", "/etc/a", "C:a", "a.", "con", "LPT1.old", "a\0", "a\tb", "=1+1", "-a", "a*", "x" * 201],
)
def test_a_name_that_would_lead_elsewhere_or_be_no_file_everywhere_cannot_be_a_cases(name: str) -> None:
    assert "cannot be the name of a case" in name_problem(name)


@pytest.mark.parametrize(
    ("name", "told"), [("=1+1", "'=1+1'"), ("M\udcfcller", "M\\udcfcller"), ("a\n\x1b[31m", "a\\n\\x1b[31m"), ("a*", "a*")]
)
def test_a_name_that_cannot_be_a_cases_can_be_written_into_a_table(name: str, told: str) -> None:
    assert told_name(name) == told
    assert name_problem(name).isprintable()
    assert (told_name(name) + name_problem(name)).encode()


@pytest.mark.parametrize("name", ["Müller, Ä", "case 1 (2).b", "_a+b-c", "肝"])
def test_files_are_named_as_people_name_scans(name: str) -> None:
    assert name_problem(name) == ""


@pytest.mark.parametrize("other", ["case 1", "CASE 1", "Case 1"])
def test_two_names_that_some_disk_takes_for_the_same_are_refused(tmp_path: Path, other: str) -> None:
    with pytest.raises(InputError, match="written to one file"):
        read_cases(table(tmp_path, HEADING, "Case 1,a.nrrd,a.json", f"{other},b.nrrd,b.json"))


def test_the_same_letters_put_together_differently_are_one_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="written to one file"):
        read_cases(table(tmp_path, HEADING, "M\u00f6,a.nrrd,a.json", "Mo\u0308,b.nrrd,b.json"))


def test_a_folder_has_volumes_with_points_beside_them_and_dicom_folders_with_points_inside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    touch(tmp_path, "a.b.nii.gz", "a.b.annotations.json", "a.b.json", "c/1.dcm", "c/annotations.json", "out/cohort.csv")
    touch(tmp_path, "labels.nrrd", "a.b.seg.nrrd", ".hidden.nrrd", "._a.b.nii.gz", "._a.b.annotations.json")

    cases = read_cases(tmp_path)

    assert [(case.name, case.volume.name, case.annotations.name) for case in cases] == [
        ("c", "c", "annotations.json"),
        ("a.b", "a.b.nii.gz", "a.b.annotations.json"),
    ]
    assert "left out, without an annotations file: labels" in caplog.text


@pytest.mark.parametrize("file", ["d/1.dcm", "d/study/1.dcm"])
def test_a_dicom_folder_without_points_is_told_of(tmp_path: Path, caplog: pytest.LogCaptureFixture, file: str) -> None:
    touch(tmp_path, "c/1.dcm", "c/annotations.json", "results/a.png", file)
    (tmp_path / file).write_bytes(bytes(128) + b"DICM")
    assert [case.name for case in read_cases(tmp_path)] == ["c"]
    assert "left out, without an annotations file: d" in caplog.text
    assert "results" not in caplog.text


def test_the_folders_that_windows_has_at_the_top_of_a_disk_are_not_looked_into(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    touch(tmp_path, "a.nii", "a.annotations.json", "System Volume Information/tracking.log", "$RECYCLE.BIN/desktop.ini")
    is_file = Path.is_file

    def refused(path: Path) -> bool:
        if path.parent != tmp_path:
            raise PermissionError(13, "Access is denied", str(path))
        return is_file(path)

    monkeypatch.setattr(Path, "is_file", refused)
    assert [case.name for case in read_cases(tmp_path)] == ["a"]


def test_points_of_a_dicom_folder_may_have_the_name_that_they_were_saved_under(tmp_path: Path) -> None:
    touch(tmp_path, "a/1.dcm", "a/3_ T1 axial.annotations.json", "b/1.dcm", "b.annotations.json", "a/._x.annotations.json")
    touch(tmp_path, "site/scan.nii.gz", "site/scan.annotations.json", "c/1.dcm")  # Other cases, and none.
    cases = [(case.name, case.volume.name, case.annotations.name) for case in read_cases(tmp_path)]
    assert cases == [("a", "a", "3_ T1 axial.annotations.json"), ("b", "b", "b.annotations.json")]


@pytest.mark.parametrize(
    "points", [["a/annotations.json", "a/T1.annotations.json"], ["a/T1.annotations.json", "a.annotations.json"]]
)
def test_a_dicom_folder_with_two_files_of_points_is_refused_with_their_names(tmp_path: Path, points: list[str]) -> None:
    touch(tmp_path, "a/1.dcm", *points)
    with pytest.raises(InputError, match="has several annotations files") as refusal:
        read_cases(tmp_path)
    assert all(str(tmp_path / name) in str(refusal.value) for name in points)


def test_a_volume_and_a_folder_of_one_name_are_not_told_apart_by_points(tmp_path: Path) -> None:
    touch(tmp_path, "a/1.dcm", "a.nii.gz", "a.annotations.json")
    with pytest.raises(InputError, match=r"needs one volume beside it.*found a, a"):
        read_cases(tmp_path)


@pytest.mark.parametrize("volumes", [[], ["a.nii", "a.nrrd"]])
def test_points_without_a_volume_or_with_two_are_refused(tmp_path: Path, volumes: list[str]) -> None:
    touch(tmp_path, "a.annotations.json", *volumes)
    with pytest.raises(InputError, match="needs one volume beside it"):
        read_cases(tmp_path)


def test_a_pair_of_files_is_one_volume(tmp_path: Path) -> None:
    touch(tmp_path, "a.hdr", "a.img", "a.annotations.json")
    (case,) = read_cases(tmp_path)
    assert (case.name, case.volume) == ("a", tmp_path / "a.hdr")
