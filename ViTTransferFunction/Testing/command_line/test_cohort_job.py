"""When a case counts as done, what the table says of it, and how a computer is shared out."""

from __future__ import annotations

import codecs
import csv
import json
import os
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
import torch

from ViTTransferFunction.CommandLine.cohort import cluster_size, folder_lock
from ViTTransferFunction.CommandLine.cohort import job as job_module
from ViTTransferFunction.CommandLine.cohort.case_work import segment_case
from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.CommandLine.cohort.cluster_size import ClusterSize, fitted_size, largest_first, local_size
from ViTTransferFunction.CommandLine.cohort.folder_lock import only_cohort_in
from ViTTransferFunction.CommandLine.cohort.job import CaseJob, CohortSettings
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.CommandLine.cohort.table import CohortTable
from ViTTransferFunction.CommandLine.cohort_command import run
from ViTTransferFunction.CommandLine.vittf import build_parser, main
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.file_lock import take_lock
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.download import sha256_of
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.attack.scans import make_scan, write_dicom
from ViTTransferFunction.Testing.files.test_several_series import write_two
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict
from ViTTransferFunction.Testing.support.torch_threads import torch_threads

HEADER = "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = a.raw\n"
REPORT = {"classes": [{"name": "liver", "millilitres": 12.5}]}


@pytest.fixture
def job(tmp_path: Path) -> CaseJob:
    """A case that was segmented: the files hold anything, but for the header, which says where the voxels are."""
    for name in ("a.raw", "a.json"):
        (tmp_path / name).write_text(name)
    (tmp_path / "a.mhd").write_text(HEADER)
    (tmp_path / "out").mkdir()
    case = Case("a", tmp_path / "a.mhd", tmp_path / "a.json")
    job = CaseJob(case, CohortSettings(SessionSettings(model="m", weights_path="w"), "f00d"), tmp_path / "out")
    job.output.write_text("segmentation")
    job.write_record(job.digest(), 3.5, REPORT)
    return job


def changed(job: CaseJob, **session: Any) -> CaseJob:
    return replace(job, settings=replace(job.settings, session=replace(job.settings.session, **session)))


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CohortSettings:
    """Of a cohort with a model that takes no time."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    weights = tmp_path / "tiny.pth"
    torch.save(random_state_dict(TINY_MODEL), weights)
    return CohortSettings(SessionSettings(model="tiny", weights_path=str(weights), grid=8, device="cpu"), sha256_of(weights))


def write_noise(path: Path) -> None:
    sitk.WriteImage(sitk.GetImageFromArray(np.random.default_rng(0).integers(0, 100, (6, 7, 8)).astype(np.int16)), str(path))


def test_a_case_is_done_whose_files_and_settings_are_the_same(job: CaseJob) -> None:
    assert job.finished() == CaseOutcome("a", "unchanged", 3.5, {"liver": 12.5})


def test_what_was_warned_of_is_said_again_of_a_case_that_is_not_computed_again(job: CaseJob) -> None:
    job.write_record(job.digest(), 3.5, REPORT, ["slices may be missing", "too large"])
    assert job.finished() == CaseOutcome("a", "unchanged", 3.5, {"liver": 12.5}, "slices may be missing; too large")


def test_a_series_with_a_slice_missing_is_segmented_and_its_line_in_the_table_says_so(
    tmp_path: Path, tiny: CohortSettings
) -> None:
    scan = make_scan(random.Random(0), ("int16",))
    write_dicom(tmp_path / "scan", scan)[len(scan.array) // 2].unlink()
    points = tmp_path / "scan" / "annotations.json"
    points.write_text('{"coordinate_system": "IJK", "classes": [{"name": "first", "positive": [[1, 1, 1]]}]}')
    outcome = segment_case(CaseJob(Case("scan", tmp_path / "scan", points), tiny, tmp_path))
    assert outcome.status == "done"
    assert "slices seem to be missing" in outcome.message


def test_a_case_with_an_empty_structure_is_segmented_and_its_line_in_the_table_says_so(
    tmp_path: Path, tiny: CohortSettings
) -> None:
    write_noise(tmp_path / "scan.nrrd")
    points = tmp_path / "scan.annotations.json"
    classes = [{"name": name, "positive": [[4, 3, 3]]} for name in ("liver", "spleen")]
    points.write_text(json.dumps({"coordinate_system": "IJK", "classes": classes}))
    job = CaseJob(Case("scan", tmp_path / "scan.nrrd", points), tiny, tmp_path)
    outcome, again = segment_case(job), job.finished()
    assert outcome.status == "done"
    assert outcome.message.startswith("Class 'spleen' has no voxel")
    assert again is not None
    assert again.message == outcome.message


def test_a_case_whose_points_are_not_where_its_line_says_is_told_so_as_by_vittf_segment(job: CaseJob) -> None:
    job.case.annotations.unlink()
    outcome = segment_case(job)
    assert (outcome.status, outcome.message) == ("refused", f"There is no file {job.case.annotations}. Check the path.")
    job.case.annotations.mkdir()
    assert segment_case(job).message == f"{job.case.annotations} is a folder; name a file."


def test_a_case_is_segmented_on_the_series_that_its_line_names_and_not_done_once_that_changes(
    tmp_path: Path, tiny: CohortSettings
) -> None:
    write_two(tmp_path / "disk")
    points = tmp_path / "points.json"
    points.write_text('{"coordinate_system": "IJK", "classes": [{"name": "first", "positive": [[1, 1, 4]]}]}')
    cases = [Case("a", tmp_path / "disk", points, series) for series in ("12", "2", None)]
    job, other, unnamed = (CaseJob(case, tiny, tmp_path) for case in cases)

    assert segment_case(job).status == "done"

    finished = job.finished()
    assert finished is not None
    assert finished.status == "unchanged"
    assert other.finished() is None
    assert "outside" in segment_case(other).message
    assert "holds 2 DICOM volumes" in segment_case(unnamed).message


def test_a_worker_with_other_weights_writes_nothing_and_what_somebody_corrected_is_moved_and_said_to_be(
    tmp_path: Path, tiny: CohortSettings
) -> None:
    write_noise(tmp_path / "scan.nrrd")
    points = tmp_path / "points.json"
    points.write_text('{"coordinate_system": "IJK", "classes": [{"name": "first", "positive": [[4, 3, 3]]}]}')
    case = Case("scan", tmp_path / "scan.nrrd", points)
    right, other = (CaseJob(case, CohortSettings(tiny.session, sha256), tmp_path) for sha256 in (tiny.weights_sha256, "f00d"))
    right.output.write_text("corrected")

    refused = segment_case(other)
    assert (refused.status, right.output.read_text()) == ("refused", "corrected")
    assert "worker's weights file has SHA-256" in refused.message

    done = segment_case(right)
    assert done.status == "done"
    assert f"is now {tmp_path / 'kept' / 'scan-1.seg.nrrd'}" in done.message


@pytest.mark.parametrize("name", ["a.mhd", "a.raw", "a.json"])
def test_a_case_is_not_done_once_its_header_voxels_or_points_change(job: CaseJob, name: str) -> None:
    with (job.case.volume.parent / name).open("a") as file:
        file.write("Comment = other\n")
    assert job.finished() is None


@pytest.mark.parametrize("change", [{"preset": "fine"}, {"grid": 32}, {"window": (0.0, 1.0)}, {"model": "n"}])
def test_a_case_is_not_done_once_a_setting_changes(job: CaseJob, change: dict[str, Any]) -> None:
    assert changed(job, **change).finished() is None


def test_a_case_is_not_done_once_weights_refinement_or_components_change(job: CaseJob) -> None:
    others = {"weights_sha256": "beef"}, {"method": "none"}, {"only_annotated_components": False}
    assert [replace(job, settings=replace(job.settings, **other)).finished() for other in others] == [None] * 3


@pytest.mark.parametrize(
    ("name", "other"),
    [("package_version", lambda package: "99.0"), ("FORMAT_VERSION", 99), ("preset", lambda preset: "with other numbers")],
)
def test_a_case_is_not_done_once_another_version_would_segment_it(
    job: CaseJob, monkeypatch: pytest.MonkeyPatch, name: str, other: Any
) -> None:
    monkeypatch.setattr(job_module, name, other)
    assert job.finished() is None


def test_where_files_lie_and_what_computes_does_not_matter(job: CaseJob, tmp_path: Path) -> None:
    (tmp_path / "moved").mkdir()
    for name in ("a.mhd", "a.raw", "a.json"):
        (tmp_path / name).rename(tmp_path / "moved" / name)
    moved = replace(job, case=Case("a", tmp_path / "moved" / "a.mhd", tmp_path / "moved" / "a.json"))
    assert changed(moved, device="cpu", weights_path="elsewhere").finished() is not None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"digest": 3}', '{"digest": '])
def test_a_damaged_record_counts_as_none(job: CaseJob, text: str) -> None:
    job.record.write_text(text)
    assert job.finished() is None


def test_a_case_whose_segmentation_is_gone_is_not_done(job: CaseJob) -> None:
    job.output.unlink()
    assert job.finished() is None


def test_what_somebody_corrected_stays_done_and_the_table_says_that_its_figures_are_older(job: CaseJob) -> None:
    job.output.write_text("corrected")
    finished = job.finished()
    assert finished is not None
    assert "changed since" in finished.message


def test_what_somebody_corrected_is_moved_and_not_replaced_and_what_was_computed_is_replaced(job: CaseJob) -> None:
    assert job.keep_corrected_output() is None
    assert job.output.exists()
    for number, text in enumerate(("corrected", "corrected again"), start=1):
        job.output.write_text(text)
        assert job.keep_corrected_output() == job.folder / "kept" / f"a-{number}.seg.nrrd"
    assert [path.read_text() for path in sorted((job.folder / "kept").iterdir())] == ["corrected", "corrected again"]


def test_the_table_has_a_line_for_each_case_and_a_column_for_each_structure(tmp_path: Path) -> None:
    table = CohortTable(tmp_path / "t.csv", ["b", "a", "c"])
    table.put(CaseOutcome("a", "done", 1.25, {"liver": 3.0, "=1+1": 2.0}))
    table.put(CaseOutcome("b", "refused", message='said, "no"\nto it'))

    with table.path.open(newline="", encoding="utf-8-sig") as file:
        rows = list(csv.reader(file))

    assert rows == [
        ["case", "status", "seconds", "ml liver", "ml =1+1", "message"],
        ["b", "refused", "", "", "", 'said, "no" to it'],
        ["a", "done", "1.2", "3.000", "2.000", ""],
        ["c", "waiting", "", "", "", ""],
    ]


def test_spreadsheets_see_that_the_table_is_in_utf_8(tmp_path: Path) -> None:
    table = CohortTable(tmp_path / "t.csv", ["Möller"])
    table.save()
    table.save()
    assert table.path.read_bytes().split(b"\r\n")[0] == codecs.BOM_UTF8 + b"case,status,seconds,message"


def test_a_table_that_cannot_be_written_now_does_not_stop_the_cases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A spreadsheet keeps it open, say, on Windows."""
    table = CohortTable(tmp_path / "t.csv", ["a", "b"])
    with monkeypatch.context() as closed:
        closed.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(PermissionError(13, "in use")))
        table.put(CaseOutcome("a", "done"))
        assert "in use" in caplog.text
        table.put(CaseOutcome("b", "done"))
        with pytest.raises(InputError, match="in use"):
            table.save()
    assert caplog.text.count("in use") == 1
    table.save()
    assert table.path.read_bytes().count(b"done") == 2


@pytest.mark.parametrize(
    ("cases", "cores", "case_gb", "free_gb", "size"),
    [
        (100, 8, 2, 64, ClusterSize(8, 1)),
        (100, 8, 2, 10, ClusterSize(4, 2)),
        (3, 8, 2, 64, ClusterSize(3, 2)),
        (100, 2, 8, 4, ClusterSize(1, 2)),
    ],
    ids=["a core each", "as memory allows", "a case each", "one at least"],
)
def test_workers_are_as_many_as_cores_cases_and_memory_allow(
    cases: int, cores: int, case_gb: int, free_gb: int, size: ClusterSize
) -> None:
    assert fitted_size(cases, cores, case_gb * 10**9, free_gb * 10**9) == size


def test_memory_for_a_worker_does_not_depend_on_the_threads_of_the_process_that_asks(
    tiny: CohortSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("dask.system")
    write_noise(tmp_path / "a.nrrd")
    asked: list[int] = []

    def note(cases: int, cores: int, case_bytes: int, free_bytes: int | None) -> ClusterSize:
        asked.append(case_bytes)
        return ClusterSize(1, 1)

    monkeypatch.setattr(cluster_size, "fitted_size", note)
    for threads in (1, 12):
        with torch_threads(threads):
            local_size([Case("a", tmp_path / "a.nrrd", tmp_path / "a.json")], tiny.session)
    assert asked[0] == asked[1]


def test_a_damaged_header_that_itk_crashes_on_does_not_end_the_program_that_orders_the_cases(tmp_path: Path) -> None:
    header = b"NRRD0004\ntype: short\ndimension: 3\nsizes: 4 4 4\nencoding: " + b"z" * 3000 + b"\n\n"
    (tmp_path / "damaged.nrrd").write_bytes(header + bytes(128))
    sitk.WriteImage(sitk.Image([4, 4, 4], sitk.sitkInt16), str(tmp_path / "sound.nrrd"))
    cases = [Case(name, tmp_path / name, tmp_path / "a.json") for name in ("damaged.nrrd", "missing.nrrd", "sound.nrrd")]

    assert [case.name for case in largest_first(cases)] == ["sound.nrrd", "damaged.nrrd", "missing.nrrd"]


@pytest.mark.parametrize(
    ("folder", "message"),
    [(".", "written over the table of cases"), ("in", "would mix with what they are made from")],
    ids=["the table", "a volume's folder"],
)
def test_results_never_replace_what_they_are_made_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    (tmp_path / "cohort.csv").write_text("case,volume,annotations\na,in,a.json\n")
    args = build_parser().parse_args(["cohort", "cohort.csv", "-o", folder])
    with pytest.raises(InputError, match=message):
        run(args)


@pytest.mark.parametrize(
    ("volume", "points", "message"),
    [
        ("out/a.seg.nrrd", "a.json", "the segmentation of case 'a' would be written over the volume of case 'a'"),
        ("a.nrrd", "out/a.cohort.json", "the record of case 'a' would be written over the annotations of case 'a'"),
    ],
    ids=["a volume", "points"],
)
def test_the_files_of_a_case_never_replace_what_they_are_made_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, volume: str, points: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cohort.csv").write_text(f"case,volume,annotations\na,{volume},{points}\n")
    args = build_parser().parse_args(["cohort", "cohort.csv", "-o", "out"])
    with pytest.raises(InputError, match=message):
        run(args)


def test_one_cohort_at_a_time_writes_to_a_folder(tmp_path: Path) -> None:
    with only_cohort_in(tmp_path / "out"):
        with pytest.raises(InputError, match="Another cohort is writing"), only_cohort_in(tmp_path / "out"):
            pytest.fail("it was let in")
        with only_cohort_in(tmp_path / "other"):
            pass
    with only_cohort_in(tmp_path / "out"):
        pass
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.skipif(os.name == "nt", reason="Windows removes no open file")
def test_a_cohort_that_begins_as_another_one_ends_keeps_others_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[bool] = []

    def take_after_the_end_of_another(descriptor: int) -> bool | None:
        if not ended:
            (tmp_path / folder_lock.LOCK).unlink()
            ended.append(True)
        return take_lock(descriptor)

    monkeypatch.setattr(folder_lock, "take_lock", take_after_the_end_of_another)
    with only_cohort_in(tmp_path), pytest.raises(InputError, match="Another cohort is writing"), only_cohort_in(tmp_path):
        pytest.fail("it was let in")
    assert not list(tmp_path.iterdir())


def test_a_cohort_that_was_killed_keeps_nobody_out(tmp_path: Path) -> None:
    program = """
import os, sys
from pathlib import Path
from ViTTransferFunction.CommandLine.cohort.folder_lock import only_cohort_in
with only_cohort_in(Path(sys.argv[1])):
    os._exit(9)
"""
    assert subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False).returncode == 9
    with only_cohort_in(tmp_path):
        pass


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--workers", "0"], "expected 1 or more"),
        (["--workers", "2", "--scheduler", "tls://there:8786"], "one of --workers and --scheduler"),
        (["--scheduler", ""], "--scheduler has no value; of a variable that is not set, perhaps"),
        (["--preset", "best"], "Unknown preset"),
    ],
)
def test_options_that_cannot_be_used_are_refused(
    tmp_path: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cases.csv").write_text("case,volume,annotations\na,a.nrrd,a.json\n")
    assert main(["cohort", str(tmp_path / "cases.csv"), "-o", str(tmp_path / "out"), *options]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_is_small_has_a_volume_in_the_table_too(tmp_path: Path) -> None:
    table = CohortTable(tmp_path / "t.csv", ["wasp"])
    table.put(CaseOutcome("wasp", "done", 1.25, {"brain": 0.00012346, "body": 0.01412}))
    assert table.path.read_text(encoding="utf-8-sig").splitlines()[1] == "wasp,done,1.2,0.0001235,0.01412,"
