"""The compute process as an operating system sees it: started by a launcher, killed, busy, or not to be started at all."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from ViTTransferFunction.Logic.compute import client as client_module
from ViTTransferFunction.Logic.compute import process as process_module
from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.process import ComputeProcess
from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import Labels, Prepare, TakeVolume
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.event_loop import polls_until
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.stub_process import ROOT, one_reply_of_labels, stub_executable
from ViTTransferFunction.Testing.support.windows_files import left_in

# What Slicer's PythonSlicer does: it starts another program, waits, and complains if that did not end by itself.
LAUNCHER = """
import subprocess, sys
ended = subprocess.run([sys.executable, *sys.argv[1:]], check=False)
if ended.returncode < 0:
    print("error: [bin/../bin/python-real] exit abnormally - Report the problem.", file=sys.stderr)
    sys.exit(1)
"""
SAYS_ITS_NUMBER = """
import json, os
body = {"type": "Started", "values": {"pid": os.getpid()}}
print(json.dumps({"content": {"number": 0, "body": body}}), flush=True)
"""
BUSY = f"""{SAYS_ITS_NUMBER}
import sys
sys.path.insert(0, {str(ROOT)!r})
from ViTTransferFunction.Testing.support.event_loop import idle_with_the_lock
idle_with_the_lock(600.0)
"""
ANSWERS_AT_ONCE = """
import json, sys
for number, _ in enumerate(sys.stdin, 1):
    print(json.dumps({"content": {"number": number, "body": {"type": "Done", "values": {}}}}), flush=True)
"""
LABELS_SHAPE = (300, 512, 512)


@pytest.fixture
def executable(tmp_path: Path) -> Callable[[str], Path]:
    """Makes a program to start in the place of Python."""
    return lambda program: stub_executable(tmp_path, program)


def runs(pid: int) -> bool:
    """Whether a process does anything yet; one that has ended may still be listed."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_a_large_reply_comes_at_once_where_the_event_loop_holds_python_s_lock(
    executable: Callable[[str], Path], start: Callable[..., ComputeClient]
) -> None:
    client = start(executable(one_reply_of_labels(LABELS_SHAPE)))
    # On a busy computer, a Python takes longer to start than a reply to come.
    polls_until(lambda: bool(client.replies() or client._process.own_pid))
    client.request(Prepare(SessionSettings()))
    replies: list[tuple[int, Labels]] = []

    def arrived() -> bool:
        replies.extend(client.replies())
        return bool(replies)

    # Through the pipe, 80 MB took more than 500 polls.
    assert polls_until(arrived) < 300
    ((number, reply),) = replies
    assert (number, reply.array.shape, reply.array.dtype) == (1, LABELS_SHAPE, np.uint8)
    assert (reply.array[-1] == 7).all()
    assert not reply.array[:-1].any()


@pytest.mark.slow
def test_asking_for_replies_ends_also_where_the_processor_is_lost_for_longer_than_it_may_wait(
    executable: Callable[[str], Path], start: Callable[..., ComputeClient], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A millisecond is lost where others have the processors; a microsecond is anywhere, once in a thousand times.
    monkeypatch.setattr(client_module, "_TURN_S", 1e-6)
    client = start(executable(ANSWERS_AT_ONCE))
    numbers = list(range(1, 5001))
    answered: list[int] = []

    def ask() -> None:
        for asked in numbers:
            client.request(Prepare(SessionSettings()))
            while len(answered) < asked:
                answered.extend(number for number, _ in client.replies())

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    asking.join(300.0)
    assert answered == numbers


@pytest.mark.slow
def test_the_number_is_the_process_s_own_and_closing_ends_it_with_its_launcher(
    executable: Callable[[str], Path], start: Callable[..., ComputeClient]
) -> None:
    client = start(executable(LAUNCHER))
    launcher = client.pid
    polls_until(lambda: bool(client.replies() or client.pid != launcher))
    pid = client.pid
    client.close()
    assert not client.alive
    assert not runs(pid)
    assert not runs(launcher)


def test_a_process_that_never_reads_its_input_is_ended_with_its_launcher(
    executable: Callable[[str], Path], start: Callable[..., ComputeClient], tmp_path: Path
) -> None:
    (tmp_path / "busy.py").write_text(BUSY)
    launch = f"import subprocess, sys\nsubprocess.run([sys.executable, {str(tmp_path / 'busy.py')!r}], check=False)\n"
    client = start(executable(launch))
    launcher = client.pid
    polls_until(lambda: bool(client.replies() or client.pid != launcher))
    pid = client.pid
    client.close()
    assert not runs(launcher)
    # What another process started cannot be waited for: it was killed, and is gone when the operating system comes to it.
    polls_until(lambda: not runs(pid))


@pytest.mark.slow
def test_what_the_launcher_says_of_a_killed_process_does_not_pass_for_its_reason(
    executable: Callable[[str], Path], start: Callable[..., ComputeClient]
) -> None:
    client = start(executable(LAUNCHER))
    launcher = client.pid
    polls_until(lambda: bool(client.replies() or client.pid != launcher))
    psutil.Process(client.pid).kill()
    polls_until(lambda: bool(client.replies() or not client.alive))
    assert client.last_words() == ""


SAYS_WHERE_IT_WAS = """
import sys
for what in {stopped_by!r}:
    print(f"{{what}}\\n\\nCurrent thread 0x00001a2c (most recent call first):", file=sys.stderr)
    print('  File "C:\\\\Slicer\\\\vision_transformer.py", line 160 in _add_attention', file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("stopped_by", "reason"),
    [
        (
            ("Windows fatal exception: code 0x8001010d", "Windows fatal exception: access violation"),
            "Windows fatal exception: access violation",
        ),
        (("Fatal Python error: Aborted", "Fatal Python error: Segmentation fault"), "Fatal Python error: Aborted"),
    ],
    ids=["after what a library lived through", "before a crash while Python says where it was"],
)
def test_of_several_things_that_are_said_to_have_stopped_the_process_the_one_that_did_is_the_reason(
    stopped_by: tuple[str, ...], reason: str, executable: Callable[[str], Path], start: Callable[..., ComputeClient]
) -> None:
    client = start(executable(SAYS_WHERE_IT_WAS.format(stopped_by=stopped_by)))
    polls_until(lambda: bool(client.replies() or not client.alive))
    assert client.last_words() == reason


@pytest.mark.parametrize("python", ["", "/nowhere/PythonSlicer"])
def test_where_python_is_missing_one_sentence_says_so(python: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", python)
    with pytest.raises(InputError, match="Python was not found"):
        ComputeClient()


def test_where_no_temporary_file_can_be_made_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> str:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp', '/var/tmp']")

    monkeypatch.setattr("tempfile.gettempdir", full)
    with pytest.raises(InputError, match=r"No temporary files can be kept: .* Make room"):
        ComputeClient()


def test_a_process_that_cannot_be_started_is_reported_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, temporary = tmp_path / "no program", tmp_path / "temporary"
    file.write_text("")
    temporary.mkdir()
    monkeypatch.setattr(process_module, "IN_MEMORY", tmp_path / "none")
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    volume = TakeVolume(np.zeros((2, 2, 2)), Geometry((2, 2, 2), np.eye(4)), "CT")
    proxy = SegmentationProxy(lambda: ComputeClient(file))
    proxy.open(volume, SessionSettings())
    assert "could not be started" in (proxy.take_error() or "")
    proxy.extract()
    assert "could not be started" in (proxy.take_error() or "")
    assert (proxy.phase, proxy.busy, proxy.pid) == ("no features", False, None)
    assert list(temporary.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("python_path", ["", os.pathsep, "."], ids=["usual", "with an empty entry", "with a relative entry"])
def test_programs_in_the_working_folder_are_not_taken_for_libraries(
    python_path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: Callable[..., ComputeClient]
) -> None:
    for name in ("sitecustomize", "types", "numpy", "scipy", "queue", "torch"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('run from the working folder')")
    monkeypatch.setenv("PYTHONPATH", python_path)
    monkeypatch.chdir(tmp_path)
    client = start()
    client.request(Prepare(SessionSettings()))
    polls_until(lambda: bool(client.replies()) or not client.alive)
    assert client.alive, client.last_words()


@pytest.mark.slow
def test_relative_paths_begin_where_the_user_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: Callable[..., ComputeClient], spheres: Spheres
) -> None:
    (tmp_path / "mine.pt").write_bytes(b"no weights")
    monkeypatch.chdir(tmp_path)
    client = start()
    client.request(TakeVolume(spheres[0].array, spheres[0].geometry, "spheres"))
    client.request(Prepare(SessionSettings(weights_path="mine.pt")))
    replies: list[tuple[int, Any]] = []

    def answered() -> bool:
        replies.extend(client.replies())
        return len(replies) == 2 or not client.alive

    polls_until(answered)
    assert "mine.pt is not a weights file" in replies[-1][1].message


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows keeps the folder that a program is in")
def test_a_working_folder_that_was_deleted_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: Callable[..., ComputeClient]
) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    client = start()
    client.request(Prepare(SessionSettings()))
    polls_until(lambda: bool(client.replies()) or not client.alive)
    assert client.alive, client.last_words()


@pytest.mark.slow
def test_only_the_user_can_read_the_arrays_and_closing_leaves_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_module, "IN_MEMORY", tmp_path)
    monkeypatch.setattr(process_module, "ROOM_BYTES", 0)
    process = ComputeProcess()
    assert process.folder.parent == tmp_path
    # Windows has other permissions.
    assert os.name == "nt" or process.folder.stat().st_mode & 0o077 == 0
    process.end()
    process.clean_up()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("room_bytes", "where"), [(0, "memory"), (2**62, "disk")])
def test_arrays_stay_in_memory_where_there_is_room(
    room_bytes: int, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("memory", "disk"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(process_module, "IN_MEMORY", tmp_path / "memory")
    monkeypatch.setattr(process_module, "ROOM_BYTES", room_bytes)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "disk"))
    process = ComputeProcess()
    assert process.folder.parent == tmp_path / where
    process.end()
    process.clean_up()


NEVER_READS = "import time\nprint(flush=True)\ntime.sleep(600)\n"


def test_a_process_is_ended_also_where_its_input_cannot_be_closed_while_somebody_writes_to_it(
    executable: Callable[[str], Path],
) -> None:
    """On Windows, closing waits for a write that does not end, since nobody reads, until the process is no more."""
    process = ComputeProcess(executable(NEVER_READS))
    close = process.requests.close

    def close_when_nobody_could_read() -> None:
        process._process.wait()
        close()

    process.requests.close = close_when_nobody_could_read  # type: ignore[method-assign]
    ending = threading.Thread(target=process.end, daemon=True)
    ending.start()
    ending.join(60.0)
    assert not ending.is_alive()
    assert not process.runs
    process.clean_up()


def test_on_windows_a_launcher_is_ended_also_where_what_it_started_is_gone(
    executable: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    process = ComputeProcess(executable(NEVER_READS))
    process.own_pid, kill = 1, os.kill

    def refused_for_what_is_gone(number: int, sent: int) -> None:
        if number == process.own_pid:
            raise PermissionError(13, "Access is denied")
        kill(number, sent)

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os, "kill", refused_for_what_is_gone)
    ending = threading.Thread(target=process.end, daemon=True)
    ending.start()
    ending.join(60.0)
    assert not ending.is_alive()
    process.clean_up()


def test_files_that_windows_still_holds_for_a_killed_process_are_removed_a_moment_later(
    executable: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    process = ComputeProcess(executable(NEVER_READS))
    (process.folder / "1-0").write_bytes(b"voxels")
    process.end()
    rmtree, refusals = shutil.rmtree, [3]

    def refused_at_first(folder: Path, **options: Any) -> None:
        if refusals[0]:
            refusals[0] -= 1
        else:
            rmtree(folder, **options)

    monkeypatch.setattr(shutil, "rmtree", refused_at_first)
    monkeypatch.setattr(sys, "platform", "win32")
    # A busy computer may stand still for longer than Windows holds them.
    monkeypatch.setattr(process_module, "_REMOVING_S", 60.0)
    process.clean_up()
    assert not process.folder.exists()


@pytest.mark.slow
def test_nothing_is_left_where_the_program_that_started_it_just_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_module, "IN_MEMORY", tmp_path)
    monkeypatch.setattr(process_module, "ROOM_BYTES", 0)
    process = ComputeProcess()
    (process.folder / "1-0").write_bytes(b"voxels")
    process.requests.close()
    polls_until(lambda: not process.runs)
    assert left_in(tmp_path) == []
    process.end()
    process.clean_up()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows removes no folder with a lock that is held")
def test_where_the_temporary_folder_has_no_room_the_reason_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: Callable[..., ComputeClient]
) -> None:
    monkeypatch.setattr(process_module, "IN_MEMORY", tmp_path)
    monkeypatch.setattr(process_module, "ROOM_BYTES", 0)
    client = start()
    # Python begins in that folder, and fails in its own way where it is gone by then.
    polls_until(lambda: bool(client.replies() or client._process.own_pid))
    (folder,) = tmp_path.glob("vittf-*")
    shutil.rmtree(folder)
    client.request(TakeVolume(np.zeros((2, 2, 2)), Geometry((2, 2, 2), np.eye(4)), "CT"))
    polls_until(lambda: bool(client.replies() or not client.alive))
    assert "no room in the folder for temporary files" in client.last_words()
