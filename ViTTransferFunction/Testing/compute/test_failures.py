"""What goes wrong in the compute process, or on the way from it, is told, and computing goes on in the next one."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import process as process_module
from ViTTransferFunction.Logic.compute.array_files import ArrayFiles
from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.codec import to_message
from ViTTransferFunction.Logic.compute.messages import read_line, write_message
from ViTTransferFunction.Logic.compute.process import ComputeProcess
from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import ComputeMaps, Failed, GivenUp, Prepare, Progressed, Taken, TakeVolume
from ViTTransferFunction.Logic.core.system.out_of_memory import OUT_OF_MEMORY
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.event_loop import polls_until
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of
from ViTTransferFunction.Testing.support.stub_process import ROOT, stub_executable
from ViTTransferFunction.Testing.support.windows_files import left_in

SETTINGS = SessionSettings(grid=GRID, device="cpu")
DONE = '{"content": {"number": 1, "body": {"type": "Done", "values": {}}}}'
ANSWERS = """
import sys
sys.stdin.buffer.readline()
sys.stdout.buffer.write({answer!r} + b"\\n")
sys.stdout.flush()
sys.stdin.read()
"""

SERVES = """
import sys
sys.path.insert(0, {root!r})
from ViTTransferFunction.Logic.compute.server import SegmentationService, main
def serve(self, request):
    {work}
SegmentationService.serve = serve
main(sys.argv[-1])
"""

ANSWERS_CLICKS_LATE = """
import sys, threading
sys.path.insert(0, {root!r})
from ViTTransferFunction.Logic.compute.requests import ComputeMaps, Prepare
from ViTTransferFunction.Logic.compute.server import SegmentationService, main
at_once, prepared = SegmentationService.serve, threading.Event()
def serve(self, request):
    if isinstance(request, ComputeMaps):
        self._progress(0, 1, "begun")
        prepared.wait()
    reply = at_once(self, request)
    if isinstance(request, Prepare):
        prepared.set()
    return reply
SegmentationService.serve = serve
main(sys.argv[-1])
"""


def final_reply(client: ComputeClient) -> Any:
    """The next reply that is no progress."""
    replies: list[Any] = []

    def answered() -> bool:
        replies.extend(reply for _, reply in client.replies() if not isinstance(reply, Progressed))
        return bool(replies) or not client.alive

    polls_until(answered)
    assert replies, client.last_words()
    return replies[0]


@pytest.mark.parametrize(
    "answer",
    [
        "nothing",
        "[" * 100_000,
        "{}",
        '{"content": {}}',
        '{"content": {"number": 1}}',
        '{"content": {"number": "one", "body": {"type": "Done", "values": {}}}}',
        '{"content": {"number": 1, "body": {"type": "Done"}}}',
        '{"content": {"number": 1, "body": {"type": ["Done"], "values": {}}}}',
        '{"content": {"number": 1, "body": {"type": "Path", "values": {}}}}',
        '{"content": {"number": 1, "body": {"type": "Done", "values": {"more": 1}}}}',
        '{"content": {"number": 1, "body": {"array": 0}}}',
        '{"content": {"number": 1, "body": [1]}}',
        DONE[:-1] + ', "arrays": 3}',
        DONE[:-1] + ', "arrays": {"file": "none", "arrays": []}}',
        DONE[:-1] + ', "arrays": {"file": "", "arrays": []}}',
        DONE.replace("Done", "D\xff"),
    ],
)
def test_an_answer_that_makes_no_sense_is_told_and_the_next_process_is_asked(
    answer: str, tmp_path: Path, start: Callable[..., ComputeClient], spheres: Spheres
) -> None:
    executable = stub_executable(tmp_path, ANSWERS.format(answer=answer.encode("latin-1")))
    clients = []

    def started() -> ComputeClient:
        clients.append(start(executable))
        return clients[-1]

    proxy = SegmentationProxy(started)
    proxy.open(TakeVolume(spheres[0].array, spheres[0].geometry, "spheres"), SETTINGS)
    polls_until(lambda: "state" in proxy.poll())
    assert "its answer could not be read" in (proxy.take_error() or "")
    assert (proxy.phase, proxy.pid) == ("no features", None)
    proxy.extract()
    assert len(clients) == 2


@pytest.mark.parametrize(
    "described",
    [
        {"arrays": []},
        {"file": "a", "arrays": [{}]},
        {"file": "a", "arrays": [{"dtype": "O", "shape": [1], "start": 0}]},
        {"file": "a", "arrays": [{"dtype": "<f4", "shape": [-1], "start": 0}]},
        {"file": "a", "arrays": [{"dtype": "<f4", "shape": [1], "start": -4}]},
        {"file": "a", "arrays": [{"dtype": "<f4", "shape": [2**40, 2**40], "start": 0}]},
        {"file": "a", "arrays": [{"dtype": "<f4", "shape": [1.5], "start": 0}]},
        {"file": "a", "arrays": [{"dtype": "no type", "shape": [1], "start": 0}]},
        {"file": "a\0b", "arrays": []},
        {"file": 3, "arrays": []},
        [],
        "a",
    ],
)
def test_arrays_that_are_wrongly_described_are_refused(described: Any, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(64))
    with pytest.raises((ValueError, OSError)):
        ArrayFiles(tmp_path).take(described)


def test_arrays_arrive_where_their_file_cannot_be_deleted_yet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = ArrayFiles(tmp_path)
    described = files.put([np.arange(3)])

    def open_elsewhere(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(errno.EACCES, "The process cannot access the file", str(path))

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", open_elsewhere)
        (array,) = files.take(described)
    np.testing.assert_array_equal(array, np.arange(3))


@pytest.mark.slow
def test_a_request_that_makes_no_sense_ends_the_process_and_the_reason_is_known() -> None:
    process = ComputeProcess()
    process.requests.write(b'{"content": {"body": {"type": "Path", "values": {}}}}\n')
    polls_until(lambda: not process.runs)
    assert "no request or reply" in process.last_words()
    process.end()
    process.clean_up()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be sent what ends it so")
def test_a_library_that_stops_the_process_is_told_of(start: Callable[..., ComputeClient]) -> None:
    client = start()
    client.request(Prepare(SETTINGS))
    final_reply(client)
    os.kill(client.pid, signal.SIGABRT)
    polls_until(lambda: bool(client.replies() or not client.alive))
    assert client.last_words() == "Fatal Python error: Aborted"


@pytest.mark.parametrize("error", ["MemoryError()", "RuntimeError('DefaultCPUAllocator: can\\'t allocate memory')"])
def test_memory_that_runs_out_is_told_in_a_sentence_and_the_process_goes_on(
    error: str, tmp_path: Path, start: Callable[..., ComputeClient]
) -> None:
    client = start(stub_executable(tmp_path, SERVES.format(root=str(ROOT), work=f"raise {error}")))
    for _ in range(2):
        client.request(Prepare(SETTINGS))
        assert final_reply(client) == Failed(OUT_OF_MEMORY)


def test_any_other_error_ends_the_process_and_is_its_last_word(tmp_path: Path, start: Callable[..., ComputeClient]) -> None:
    client = start(stub_executable(tmp_path, SERVES.format(root=str(ROOT), work="raise RuntimeError('shapes do not fit')")))
    client.request(Prepare(SETTINGS))
    polls_until(lambda: bool(client.replies() or not client.alive))
    assert client.last_words() == "RuntimeError: shapes do not fit"


def test_an_answer_that_was_given_up_may_be_late_for_its_volume(
    tmp_path: Path, start: Callable[..., ComputeClient], spheres: Spheres
) -> None:
    client = start(stub_executable(tmp_path, ANSWERS_CLICKS_LATE.format(root=str(ROOT))))
    client.request(TakeVolume(spheres[0].array, spheres[0].geometry, "spheres"))
    assert final_reply(client) == Taken(spheres[0].digest.hex())
    click = client.request(ComputeMaps(requests_of(spheres)))
    polls_until(lambda: any(isinstance(reply, Progressed) for _, reply in client.replies()) or not client.alive)
    client.cancel([click])
    client.request(Prepare(SETTINGS))
    replies: dict[int, Any] = {}

    def answered() -> bool:
        replies.update(client.replies())
        return click in replies or not client.alive

    polls_until(answered)
    assert client.last_words() == ""
    assert replies[click] == GivenUp()


@pytest.fixture
def busy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ComputeProcess]:
    """A process that computes and does not come to an end; the folder of its arrays lies in `tmp_path / "memory"`."""
    (tmp_path / "memory").mkdir()
    monkeypatch.setattr(process_module, "IN_MEMORY", tmp_path / "memory")
    monkeypatch.setattr(process_module, "ROOM_BYTES", 0)
    work = "self._progress(0, 1, 'begun')\n    while True: pass"
    process = ComputeProcess(stub_executable(tmp_path, SERVES.format(root=str(ROOT), work=work)))
    (process.folder / "1-0").write_bytes(b"voxels")
    yield process
    process.end()
    process.clean_up()


def test_a_process_that_is_computing_ends_with_its_input_and_leaves_nothing(busy: ComputeProcess, tmp_path: Path) -> None:
    files = ArrayFiles(busy.folder)
    write_message(busy.requests, to_message(1, Prepare(SETTINGS)), files)  # type: ignore[arg-type]
    while (line := read_line(busy.replies)) is not None and b"begun" not in line:  # type: ignore[arg-type]
        pass
    busy.requests.close()
    polls_until(lambda: not busy.runs)
    assert left_in(tmp_path / "memory") == []


def test_a_process_that_nobody_listens_to_ends_and_leaves_nothing(busy: ComputeProcess, tmp_path: Path) -> None:
    busy.replies.close()
    # It may end already where it says that it has started.
    with suppress(BrokenPipeError):
        write_message(busy.requests, to_message(1, Prepare(SETTINGS)), ArrayFiles(busy.folder))  # type: ignore[arg-type]
    polls_until(lambda: not busy.runs)
    assert left_in(tmp_path / "memory") == []
