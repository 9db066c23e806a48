"""`vittf` where its output goes nowhere, or to a console that lacks characters, and where there is too little of something."""

from __future__ import annotations

import errno
import io
import json
import logging
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.CommandLine.console import Unfailing, unfailing_console
from ViTTransferFunction.CommandLine.library_output import CurrentErrorStream
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.system.out_of_memory import OUT_OF_MEMORY
from ViTTransferFunction.Logic.weights import store

LISTS = [sys.executable, "-m", "ViTTransferFunction.CommandLine.vittf", "weights", "list"]


def stream_to(descriptor: int) -> io.TextIOWrapper:
    return open(descriptor, "w", encoding="utf-8", buffering=1)


def closed_pipe() -> io.TextIOWrapper:
    """A pipe that nobody reads any more."""
    read, write = os.pipe()
    os.close(read)
    return stream_to(write)


def full_device() -> io.TextIOWrapper:
    return stream_to(os.open("/dev/full", os.O_WRONLY))


DEVICES = pytest.mark.skipif(os.name == "nt", reason="Windows has no device that is full")
UNREAD = errno.EINVAL if os.name == "nt" else errno.EPIPE


@pytest.mark.parametrize(("make", "reason"), [(closed_pipe, UNREAD), pytest.param(full_device, errno.ENOSPC, marks=DEVICES)])
def test_what_cannot_be_delivered_is_dropped_and_the_reason_kept(make: Callable[[], io.TextIOWrapper], reason: int) -> None:
    stream = Unfailing(make())
    for _ in range(3):
        print("Features", file=stream)
        stream.flush()
    assert stream.trouble is not None
    assert stream.trouble.errno == reason
    # As Python does on its way out.
    stream.close()


def test_progress_on_a_pipe_that_nobody_reads_does_not_end_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", closed_pipe())
    with unfailing_console(), ProgressBar() as progress:
        for done in range(5):
            progress(done, 5, "Segmenting")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()], ids=["log", "terminal"])
def test_warnings_have_lines_of_their_own_while_progress_is_shown(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    with ProgressBar() as progress:
        progress(3, 4, "Segmenting")
        CurrentErrorStream().emit(logging.makeLogRecord({"msg": "WARNING: nothing"}))
        progress(4, 4, "Segmenting")
    assert "WARNING: nothing" in re.split(r"[\r\n]+", stream.getvalue())


def test_a_terminal_gets_a_bar_for_each_step_that_says_how_much_of_it_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    steps = ("Computing features", "Segmenting")
    with ProgressBar() as progress:
        for what in steps:
            for done in (1, 2, 4):
                progress(done, 4, what)
    for what in steps:
        last = [shown for shown in re.split(r"[\r\n]+", terminal.getvalue()) if shown.startswith(f"{what}:")][-1]
        assert "100%" in last
        assert " 4/4 " in last


def test_a_log_gets_no_bar_but_what_is_being_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", log := io.StringIO())
    with ProgressBar() as progress:
        for what, total in (("Computing features", 3), ("Segmenting", 5)):
            for done in range(total):
                progress(done, total, what)
    assert log.getvalue() == "Computing features...\nSegmenting...\n"


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp932"])
def test_names_that_a_code_page_lacks_are_spelled_by_their_numbers(encoding: str) -> None:
    shown = io.BytesIO()
    stream = Unfailing(io.TextIOWrapper(shown, encoding=encoding))
    print("肝臓 16×16 🫀 \ud800", file=stream)
    stream.flush()
    assert b"\\U0001fac0" in shown.getvalue()
    assert b"16" in shown.getvalue()


def test_there_may_be_no_console_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["weights", "list"]) == 0
    assert main(["weights", "get", "no model"]) == 2


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is always full")
def test_a_full_device_is_told_in_a_sentence() -> None:
    with Path("/dev/full").open("w") as full:
        finished = subprocess.run(LISTS, stdout=full, stderr=subprocess.PIPE, encoding="utf-8", check=False)
    assert (finished.returncode, finished.stderr) == (2, "error: The output could not be written: No space left on device.\n")


@pytest.mark.slow
def test_a_reader_that_has_gone_away_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    finished = subprocess.run(LISTS, stdout=write, stderr=subprocess.PIPE, encoding="utf-8", check=False)
    os.close(write)
    assert (finished.returncode, finished.stderr) == (0, "")


@pytest.mark.parametrize(("platform", "code"), [("win32", 0), ("linux", 2)])
def test_windows_says_of_a_reader_that_has_gone_away_that_an_argument_is_invalid(
    platform: str, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Unread(io.StringIO):
        def write(self, _: str) -> int:
            raise OSError(errno.EINVAL, "Invalid argument")

        def fileno(self) -> int:
            return os.open(os.devnull, os.O_WRONLY)

    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(sys, "stdout", Unread())
    monkeypatch.setattr(sys, "stderr", errors := io.StringIO())
    assert main(["weights", "list"]) == code
    assert bool(errors.getvalue()) == bool(code)


@pytest.mark.slow
def test_with_closed_streams_no_file_gets_what_is_printed(tmp_path: Path) -> None:
    program = (
        "import os, sys; [os.close(descriptor) for descriptor in (0, 1, 2)];"
        "from ViTTransferFunction.CommandLine.console import unfailing_console\n"
        "with unfailing_console():\n"
        f"    file = open({str(tmp_path / 'file')!r}, 'w')\n"
        "    print('text'), os.write(1, b'text'), os.write(2, b'text')\n"
    )
    subprocess.run([sys.executable, "-c", program], check=False)
    assert (tmp_path / "file").read_bytes() == b""


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (MemoryError(), OUT_OF_MEMORY),
        (RuntimeError("[enforce fail at alloc_cpu.cpp] DefaultCPUAllocator: can't allocate memory"), OUT_OF_MEMORY),
        (OSError(errno.EIO, "Input/output error", "scan.nii"), "scan.nii cannot be used: Input/output error."),
    ],
)
def test_what_the_computer_lacks_is_told_in_a_sentence(
    error: Exception, sentence: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails() -> None:
        raise error

    monkeypatch.setattr(store, "list_weights", fails)
    assert refusal(["weights", "list"], capsys) == f"error: {sentence}"


def test_a_defect_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise RuntimeError("shapes do not fit")

    monkeypatch.setattr(store, "list_weights", fails)
    with pytest.raises(RuntimeError, match="shapes"):
        main(["weights", "list"])


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps the folder that a program is in")
def test_a_current_folder_that_was_deleted_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert "current folder was deleted" in refusal(["weights", "list"], capsys)


@pytest.mark.parametrize("path", ["a\0b.nii", "x" * 300 + ".nii", "a/" * 3000 + "scan.nii"])
@pytest.mark.parametrize("place", ["volume", "--annotations", "--weights", "-o", "--report", "--similarity-dir", "--positive"])
def test_paths_that_there_cannot_be_are_refused_wherever_they_stand(
    path: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    sitk.WriteImage(sitk.GetImageFromArray(np.random.default_rng(0).normal(size=(8, 8, 8))), "scan.nrrd")
    points = {"coordinate_system": "IJK", "classes": [{"name": "liver", "positive": [[3, 3, 3]]}]}
    Path("a.json").write_text(json.dumps(points))
    Path("w.pt").write_bytes(b"no weights")
    arguments = {"volume": "scan.nrrd", "-o": "out.nii", "--annotations": "a.json", "--weights": "w.pt"}
    arguments[place] = f"liver={path}" if place == "--positive" else path
    if place == "--positive":
        del arguments["--annotations"]
    volume = arguments.pop("volume")
    line = refusal(["segment", volume, *(word for option in arguments.items() for word in option)], capsys)
    assert line.startswith("error: ")
    assert path[:20].replace("\0", "\\x00").replace("/", os.sep) in line
    assert not Path("out.nii").exists()
