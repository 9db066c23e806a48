"""`vittf cohort` on a cluster of two processes, one of which is killed."""

from __future__ import annotations

import csv
import json
import os
import signal
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
import torch

from ViTTransferFunction.CommandLine.cohort import leader
from ViTTransferFunction.CommandLine.cohort.job import CaseJob
from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.CommandLine.cohort.table import CohortTable
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support import cohort_worker
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict
from ViTTransferFunction.Testing.support.volumes import write_two_structures

dask = pytest.importorskip("dask")
# Now: where it is first loaded while a test has set something of Dask, its own defaults go with that.
pytest.importorskip("distributed")
pytest.importorskip("cryptography")
psutil = pytest.importorskip("psutil")

LEFT: dict[str, object]
RIGHT: dict[str, object]
LEFT, RIGHT = {"name": "left", "positive": [[6, 8, 6]]}, {"name": "right", "positive": [[14, 8, 6]]}


def add_case(folder: Path, name: str, classes: list[dict[str, object]]) -> None:
    """A small scan of two structures, and points."""
    write_two_structures(folder / f"{name}.nrrd")
    annotate(folder, name, classes)


def annotate(folder: Path, name: str, classes: list[dict[str, object]]) -> None:
    content = {"coordinate_system": "IJK", "classes": classes}
    (folder / f"{name}.annotations.json").write_text(json.dumps(content))


@pytest.fixture
def cohort(tmp_path: Path) -> Path:
    folder = tmp_path / "cohort"
    folder.mkdir()
    add_case(folder, "both", [LEFT, RIGHT])
    add_case(folder, "left only", [LEFT])
    add_case(folder, "outside", [{"name": "left", "positive": [[6, 8, 600]]}])
    add_case(folder, cohort_worker.KILLS_ONCE, [RIGHT])
    return folder


@pytest.fixture
def options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The tiny model, here and in workers; and no more of this computer than two workers."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    weights = tmp_path / "tiny.pth"
    torch.save(random_state_dict(TINY_MODEL), weights)
    # Dask sets variables of the environment for its workers, which the tests that follow would have.
    with dask.config.set({"distributed.worker.preload": [cohort_worker.__name__]}), patch.dict(os.environ):
        yield ["--model", "tiny", "--weights", str(weights), "--grid", "8", "--workers", "2", "--device", "cpu"]


def is_worker(process: Any) -> bool:
    return "--multiprocessing-fork" in process.cmdline()


def rows_of(table: Path) -> dict[str, dict[str, str]]:
    with table.open(encoding="utf-8-sig", newline="") as file:
        return {row["case"]: row for row in csv.DictReader(file)}


def test_a_case_whose_name_no_file_may_have_is_refused_and_the_others_are_computed(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_case(tmp_path, "good, one", [LEFT])
    cases = tmp_path / "cases.csv"
    files = "'good, one.nrrd','good, one.annotations.json'".replace("'", '"')
    cases.write_text(f'case,volume,annotations\n=1+1,{files}\n"good, one",{files}\n')
    computed: list[str] = []
    monkeypatch.setattr(leader, "_compute", lambda table, jobs, args: computed.extend(job.case.name for job in jobs))

    assert main(["cohort", str(cases), "-o", str(tmp_path / "out"), *options]) == 1

    assert computed == ["good, one"]
    rows = rows_of(tmp_path / "out" / "cohort.csv")
    # In quotes, or a spreadsheet would compute it.
    assert rows["'=1+1'"]["status"] == "refused"
    assert "cannot be the name of a case" in rows["'=1+1'"]["message"]
    assert rows["good, one"]["status"] == "waiting"


def test_a_case_whose_segmentation_is_removed_while_others_are_computed_is_not_called_done(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("kept", "removed"):
        add_case(tmp_path, name, [LEFT])
    out = tmp_path / "out"

    def compute(table: CohortTable, jobs: Sequence[CaseJob], args: object) -> None:
        for job in jobs:
            table.put(CaseOutcome(job.case.name, "done", 1.0, {"left": 1.0}))
        (out / "kept.seg.nrrd").write_bytes(b"a segmentation")

    monkeypatch.setattr(leader, "_compute", compute)

    assert main(["cohort", str(tmp_path), "-o", str(out), *options]) == 1

    rows = rows_of(out / "cohort.csv")
    assert (rows["kept"]["status"], rows["kept"]["ml left"]) == ("done", "1.000")
    assert (rows["removed"]["status"], rows["removed"]["ml left"]) == ("failed", "")
    assert "moved or removed" in rows["removed"]["message"]


@pytest.mark.slow
def test_a_cohort_survives_a_killed_worker_and_is_not_computed_twice(
    cohort: Path, options: list[str], tmp_path: Path, a_cache_of_its_own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    arguments = ["cohort", str(cohort), "-o", str(out), *options]

    assert main(arguments) == 1, "one case cannot be segmented"

    assert (a_cache_of_its_own / cohort_worker.KILLS_ONCE).exists(), "no worker was killed"
    assert not [child for child in psutil.Process().children(recursive=True) if is_worker(child)]
    rows = rows_of(out / "cohort.csv")
    assert list(rows) == ["both", cohort_worker.KILLS_ONCE, "left only", "outside"]
    assert {name: row["status"] for name, row in rows.items()} == {
        "both": "done",
        cohort_worker.KILLS_ONCE: "done",
        "left only": "done",
        "outside": "refused",
    }
    assert "lie outside the volume" in rows["outside"]["message"]
    assert not (out / "outside.seg.nrrd").exists()
    assert not list(out.glob(".*")), "temporary files were left"
    labels, geometry, segments = read_segmentation(out / "both.seg.nrrd")
    assert [segment.name for segment in segments] == ["left", "right"]
    for label, name in enumerate(("left", "right"), start=1):
        millilitres = (labels == label).sum() * geometry.voxel_volume_mm3 / 1000.0
        assert float(rows["both"][f"ml {name}"]) == pytest.approx(millilitres, abs=1e-3)
    assert rows["left only"]["ml right"] == ""
    assert float(rows["both"]["seconds"]) > 0.0

    # Again: other points in two cases, the segmentation of one of which somebody corrected; one is withdrawn.
    annotate(cohort, "both", [RIGHT])
    annotate(cohort, "left only", [LEFT, RIGHT])
    (out / "left only.seg.nrrd").write_bytes(b"corrected")
    (cohort / "outside.annotations.json").unlink()
    untouched = (out / f"{cohort_worker.KILLS_ONCE}.seg.nrrd").stat().st_mtime_ns

    assert main(arguments) == 0

    rows = rows_of(out / "cohort.csv")
    assert {name: row["status"] for name, row in rows.items()} == {
        "both": "done",
        cohort_worker.KILLS_ONCE: "unchanged",
        "left only": "done",
    }
    assert (out / f"{cohort_worker.KILLS_ONCE}.seg.nrrd").stat().st_mtime_ns == untouched
    assert [segment.name for segment in read_segmentation(out / "both.seg.nrrd")[2]] == ["right"]
    assert (out / "kept" / "left only-1.seg.nrrd").read_bytes() == b"corrected"
    assert "kept" in rows["left only"]["message"]

    # Again, with nothing to do.
    monkeypatch.setattr(leader, "_cluster", None)
    assert main(arguments) == 0
    assert {row["status"] for row in rows_of(out / "cohort.csv").values()} == {"unchanged"}
    assert rows_of(out / "cohort.csv")["both"]["ml right"] == rows["both"]["ml right"]


PROGRAM = """
import sys
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Testing.support.cohort_worker import dask_setup
dask_setup()
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a process cannot be sent a Ctrl-C there")
def test_nobody_else_gets_in_and_ctrl_c_leaves_nothing(tmp_path: Path, options: list[str], a_cache_of_its_own: Path) -> None:
    folder, out = tmp_path / "cohort", tmp_path / "out"
    folder.mkdir()
    add_case(folder, cohort_worker.NEVER_ENDS, [LEFT])
    started = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "cohort", str(folder), "-o", str(out), *options],
        env={**os.environ, "DASK_DISTRIBUTED__WORKER__PRELOAD": f"['{cohort_worker.__name__}']", "TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", start_new_session=True,
    )  # fmt: skip
    try:
        while not (a_cache_of_its_own / cohort_worker.NEVER_ENDS).exists():
            assert started.poll() is None, started.communicate()[0]
            time.sleep(0.05)
        process = psutil.Process(started.pid)
        workers = [child for child in process.children(recursive=True) if is_worker(child)]
        assert len(workers) == 1, "one case needs one worker"
        listening = [c.laddr for p in (process, *workers) for c in p.net_connections("inet") if c.status == "LISTEN"]
        assert len(listening) == 3, "scheduler, nanny and worker"
        assert {address.ip for address in listening} == {"127.0.0.1"}
        assert all(asks_for_a_key(address.port) for address in listening)

        half_written = out / ".writing-0123abcd.seg.nrrd"
        half_written.touch()
        assert main(["cohort", str(folder), "-o", str(out), *options]) == 2
        assert half_written.exists(), "another cohort removed what this one writes"

        os.killpg(started.pid, signal.SIGINT)  # As a terminal does: all processes get it.
        said, _ = started.communicate(timeout=LONGEST_WAIT_S)
    finally:
        started.kill()
    assert started.returncode == 130, said
    assert "Traceback" not in said
    assert not psutil.wait_procs(workers, timeout=LONGEST_WAIT_S)[1], "workers are left"
    assert not (tmp_path / "dask-scratch-space").exists(), "the scheduler has a folder where everybody may write"
    assert [path.name for path in out.iterdir()] == ["cohort.csv"]
    assert not list(tmp_path.glob("vittf-*"))
    assert rows_of(out / "cohort.csv")[cohort_worker.NEVER_ENDS]["status"] == "waiting"


def asks_for_a_key(port: int) -> bool:
    """Whether who listens on a port of this computer turns away those who come without a certificate."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with (
            socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S) as plain,
            context.wrap_socket(plain) as encrypted,
        ):
            encrypted.recv(1)
    except ssl.SSLError as error:
        return "CERTIFICATE_REQUIRED" in str(error)
    return False
