"""The process that cases are forked from: everything is imported, so that a run of `vittf` takes a fraction of a second.

A line of JSON on standard input asks for runs, which start together; a line on standard output says how they ended. Each run is
the real `main` in a child of this process, up to its end. The network is the tiny one of
the tests, to be had as the model "tiny".
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from ViTTransferFunction.Testing.attack.calls import PATIENCE_S, ROOM_BYTES, Call, Outcome
from ViTTransferFunction.Testing.support.loaded_python import LOADED, load

USED_BY_ALL = (
    "encodings.ascii", "encodings.cp1252", "encodings.cp437", "encodings.idna", "encodings.utf_8_sig",
    "filecmp", "multiprocessing.synchronize",
    *LOADED, "SimpleITK", "torch.nn.functional", "tqdm", "vtk",
    "vtkmodules.util.numpy_support",
    "ViTTransferFunction.CommandLine.vittf", "ViTTransferFunction.Logic.compute.server",
    "ViTTransferFunction.Logic.features.vision_transformer", "ViTTransferFunction.Logic.refinement.bilateral_solver",
    "ViTTransferFunction.Logic.refinement.guided_filter", "ViTTransferFunction.Logic.refinement.upsampling",
    "ViTTransferFunction.Logic.weights.state_dict",
)  # fmt: skip
"""Imported before the first fork, also what the program imports only where it is needed."""
_POLL_S = 0.002
_NOBODY = 65534
_ENDED_BY_FLUSH = 120
"""What Python's own exit code is where standard output could not be flushed at its end."""


def main() -> None:
    """Serve until the input ends."""
    replies = os.dup(1)
    _load()
    weights = _tiny_weights()
    os.write(replies, json.dumps({"weights": str(weights)}).encode() + b"\n")
    try:
        for line in sys.stdin.buffer:
            calls = [Call(**{**call, "arguments": tuple(call["arguments"])}) for call in json.loads(line)]
            outcomes = _run(calls, replies)
            os.write(replies, json.dumps([asdict(outcome) for outcome in outcomes]).encode() + b"\n")
    finally:
        weights.unlink()
        weights.parent.rmdir()


def _load() -> None:
    load(USED_BY_ALL)
    import torch

    # A child has none of its parent's threads, and would wait for them for ever.
    torch.set_num_threads(1)


def _tiny_weights() -> Path:
    """Write the tiny network's file where everybody may read it, and make it known as a published model."""
    import torch

    from ViTTransferFunction.Logic.weights.download import sha256_of
    from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
    from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict

    folder = Path(tempfile.mkdtemp(prefix="vittf-attack-weights-"))
    folder.chmod(0o755)
    path = folder / TINY_MODEL.file_name
    torch.save(random_state_dict(TINY_MODEL), path)
    path.chmod(0o644)
    PRETRAINED_MODELS[TINY_MODEL.name] = replace(TINY_MODEL, sha256=sha256_of(path))
    return path


@dataclass
class _Child:
    """A run under way."""

    call: Call
    pid: int
    stdout: int
    stderr: int
    started: float
    said: dict[int, bytearray] = field(default_factory=dict)
    outcome: Outcome | None = None
    signalled: bool = False


def _run(calls: Sequence[Call], replies: int) -> list[Outcome]:
    """Run all at the same time, and wait for them."""
    children = [_fork(call, replies) for call in calls]
    while any(child.outcome is None for child in children):
        for child in children:
            if child.outcome is None:
                _look_after(child)
        time.sleep(_POLL_S)
    return [child.outcome for child in children if child.outcome is not None]


def _fork(call: Call, replies: int) -> _Child:
    (out, out_end), (err, err_end), (ready, ready_end) = os.pipe(), os.pipe(), os.pipe()
    pid = os.fork()
    if pid == 0:
        for end in (replies, out, err, ready):
            os.close(end)
        _end(lambda: _as_program(call, out_end, err_end, ready_end))
    for end in (out_end, err_end, ready_end):
        os.close(end)
    # A signal before the program is one says nothing about it.
    os.read(ready, 1)
    os.close(ready)
    os.set_blocking(out, False)
    os.set_blocking(err, False)
    return _Child(call, pid, out, err, time.monotonic(), {out: bytearray(), err: bytearray()})


def _look_after(child: _Child) -> None:
    for stream in (child.stdout, child.stderr):
        _drain(child, stream)
    call, seconds = child.call, time.monotonic() - child.started
    due = seconds >= call.signal_after_s
    if call.signal_when:
        due = next(Path(call.folder).glob(call.signal_when), None) is not None
    if call.signal_name and not child.signalled and due:
        child.signalled = True
        os.kill(child.pid, signal.Signals[call.signal_name])
    hung = seconds > PATIENCE_S
    if hung:
        os.kill(child.pid, signal.SIGKILL)
    ended, status = os.waitpid(child.pid, 0 if hung else os.WNOHANG)
    if ended:
        for stream in (child.stdout, child.stderr):
            _drain(child, stream)
            os.close(stream)
        texts = (child.said[stream].decode(errors="replace") for stream in (child.stdout, child.stderr))
        child.outcome = Outcome(os.waitstatus_to_exitcode(status), hung, round(seconds, 3), *texts)


def _drain(child: _Child, stream: int) -> None:
    try:
        while part := os.read(stream, 1 << 16):
            child.said[stream] += part
    except BlockingIOError:
        pass


def _end(run: Callable[[], int]) -> None:
    """Run and end as Python does, but for the quarter of a second in which it would take down PyTorch, object by object."""
    try:
        code = run()
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        traceback.print_exc()
        code = 1
    # Whoever interrupts what is done, interrupts Python.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as error:
        sys.stderr.write(f"Exception ignored while flushing sys.stdout: {error!r}\n")
        code = _ENDED_BY_FLUSH
    os._exit(code)


def _as_program(call: Call, stdout: int, stderr: int, ready: int) -> int:
    """In the child: become the program, with all that the call asks for. Returns its exit code, if it gets that far."""
    _connect(call, stdout, stderr)
    os.chdir(call.folder)
    os.environ.clear()
    os.environ.update(call.environment)
    tempfile.tempdir = None
    if call.folder_is_gone:
        Path(call.folder).rmdir()
    _limit(call)
    program = None
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.close(ready)
        program = _program(call)
        return program()
    except KeyboardInterrupt as interruption:
        if program is not None and not _is_at_entry(interruption):
            raise
        # Before the program has begun, nobody can ask it for a sentence.
        sys.stderr.write("interrupted; nothing was left half-written\n")
        return 130


def _is_at_entry(interruption: KeyboardInterrupt) -> bool:
    """Whether it came no later than at the `def` of the program's main function, before the first line that could take it."""
    frames = list(traceback.walk_tb(interruption.__traceback__))
    frame, line = frames[-1]
    # `_as_program`, what `_program` returned, and the main function.
    return len(frames) <= 3 and line == frame.f_code.co_firstlineno


def _program(call: Call) -> Callable[[], int]:
    if call.program == "compute":
        from ViTTransferFunction.Logic.compute.server import main as serve

        def compute() -> int:
            serve(call.arguments[0])
            return 0

        return compute
    from ViTTransferFunction.CommandLine.vittf import main as vittf

    sys.argv[:] = ["vittf", *call.arguments]
    return lambda: vittf(list(call.arguments))


def _connect(call: Call, stdout: int, stderr: int) -> None:
    given, giving = os.pipe()
    # Written by a process of its own: a pipe has room for little.
    if call.given and os.fork() == 0:
        os.close(given)
        with suppress(BrokenPipeError), os.fdopen(giving, "wb") as stream:
            stream.write(call.given.encode())
            stream.flush()
            time.sleep(call.given_for_s)
        os._exit(0)
    os.close(giving)
    os.dup2(given, 0)
    if call.console == "closed":
        reading, stdout = os.pipe()
        os.close(reading)
    elif call.console == "full":
        stdout = os.open("/dev/full", os.O_WRONLY)
    os.dup2(stdout, 1)
    os.dup2(stderr, 2)
    # As Python makes them; those of the parent know what its own were connected to.
    sys.stdout = os.fdopen(1, "w", encoding=call.encoding or "utf-8", closefd=False)
    sys.stderr = os.fdopen(2, "w", encoding=call.encoding or "utf-8", errors="backslashreplace", buffering=1, closefd=False)


def _limit(call: Call) -> None:
    if sys.platform == "linux":
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + ROOM_BYTES,) * 2)
    if call.largest_file_bytes is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (call.largest_file_bytes,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if call.without_rights and os.getuid() == 0:
        os.setgroups([])
        os.setgid(_NOBODY)
        os.setuid(_NOBODY)


if __name__ == "__main__":
    main()
