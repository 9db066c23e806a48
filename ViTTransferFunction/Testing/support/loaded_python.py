"""A Python with PyTorch loaded, which is forked where tests of scene, panel and app start the compute process.

Importing PyTorch takes a processor seconds, and is most of what such a test costs. Nothing of ours is loaded beforehand: what
is forked runs the same program, with the same arguments, streams, folder and environment, in a session of its own. Linux only.
"""

from __future__ import annotations

import gc
import importlib
import io
import json
import os
import select
import signal
import socket
import subprocess
import sys
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NoReturn

ROOT = Path(__file__).parents[3]
LOADED = ("numpy", "scipy.ndimage", "scipy.optimize", "scipy.sparse.linalg", "scipy.spatial", "torch")
"""What the compute process imports of others. None of these starts a thread when it is imported; a child would lack it."""
_MOST_BYTES = 1 << 20
_PID_BYTES = 4


class LoadedPython:
    """The process that is forked, started when it is first needed; to be used in a `with` statement."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> LoadedPython:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._process is not None:
            self._orders.close()
            self._process.kill()
            self._process.wait()

    def popen(self, command: Sequence[str], **options: Any) -> ForkedProcess | subprocess.Popen[bytes]:
        """Stands in for `subprocess.Popen` in `Logic/compute/process.py`; starts by that what is no program of this Python."""
        if command[:2] != [sys.executable, "-c"]:
            return subprocess.Popen(command, **options)
        if self._process is None:
            self._load(options["env"])
        return ForkedProcess(self._orders, command, options)

    def _load(self, environment: Mapping[str, str]) -> None:
        self._orders, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # In the environment of a compute process: libraries look at some of it when they are loaded.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "ViTTransferFunction.Testing.support.loaded_python", str(theirs.fileno())],
            cwd=ROOT, env=environment, pass_fds=[theirs.fileno()], start_new_session=True,
        )  # fmt: skip
        # The only other end is now the process's own: where it ends, so does all that waits for it.
        theirs.close()


class ForkedProcess:
    """As much of a `subprocess.Popen` as `ComputeProcess` uses.

    Attributes:
        pid: its number, and that of its group.
        stdin: unbuffered.
        stdout: unbuffered.
    """

    def __init__(self, orders: socket.socket, command: Sequence[str], options: dict[str, Any]) -> None:
        (given, stdin), (stdout, said), (self._alive, alive) = os.pipe(), os.pipe(), os.pipe()
        order = {"command": command[2:], "cwd": str(options["cwd"]), "env": options["env"]}
        socket.send_fds(orders, [json.dumps(order).encode()], [given, said, options["stderr"].fileno(), alive])
        for end in (given, said, alive):
            os.close(end)
        self.stdin: IO[bytes] = io.FileIO(stdin, "wb")
        self.stdout: IO[bytes] = io.FileIO(stdout, "rb")
        self.pid = int.from_bytes(os.read(self._alive, _PID_BYTES), sys.byteorder)
        assert self.pid, "the Python to be forked has ended; what it says of errors is above"
        self._ended = False

    def poll(self) -> int | None:
        """None while it runs; else 0, whatever its exit code."""
        try:
            return self.wait(0.0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end. Raises subprocess.TimeoutExpired."""
        if not self._ended:
            # The operating system closes the other end with the process, and nothing more is ever written to it.
            poll = select.poll()
            poll.register(self._alive)
            if not poll.poll(None if timeout is None else 1000.0 * timeout):
                raise subprocess.TimeoutExpired("the forked Python", timeout or 0.0)
            os.close(self._alive)
            self._ended = True
        return 0


def load(names: Sequence[str]) -> None:
    """Import modules in a process that is going to be forked."""
    for name in names:
        importlib.import_module(name)
    gc.collect()
    # A child that collects garbage would copy all memory.
    gc.freeze()


def main() -> None:
    """Fork as often as asked, until nobody is left who could ask."""
    # `-m` puts the working folder in front.
    sys.path.pop(0)
    load(LOADED)
    # Nobody waits for the children: they shall leave nothing.
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    with socket.socket(fileno=int(sys.argv[1])) as orders:
        while True:
            order, streams, _, _ = socket.recv_fds(orders, _MOST_BYTES, 4)
            if not order:
                return
            if os.fork() == 0:
                orders.close()
                _become(json.loads(order), streams)
            for stream in streams:
                os.close(stream)


def _become(order: dict[str, Any], streams: Sequence[int]) -> NoReturn:
    """In the child: run what was asked for, to the process's end."""
    *standard, alive = streams
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    for number, stream in enumerate(standard):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(order["cwd"])
    os.environ.clear()
    os.environ.update(order["env"])
    program, *arguments = order["command"]
    sys.argv[:] = ["-c", *arguments]
    os.write(alive, os.getpid().to_bytes(_PID_BYTES, sys.byteorder))
    code = 0
    try:
        exec(program, {"__name__": "__main__"})
    except BaseException:
        traceback.print_exc()
        code = 1
    os._exit(code)


if __name__ == "__main__":
    main()
