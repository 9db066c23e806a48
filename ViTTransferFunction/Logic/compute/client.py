"""The compute process, seen from the program that started it: requests go there, replies come back, and nothing ever waits.

PyTorch lives in a process of its own. Importing it, or one long operation, would freeze a window for as long as it holds
Python's global lock; its OpenMP would meet the host program's; and running out of memory would take the user's unsaved work
along.
"""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

from .codec import from_message, to_message
from .messages import Message, read_message, write_message
from .requests import Cancel

# The package is made by hand: its own file imports the host program's modules, which the process does not have.
_BOOTSTRAP = """
import sys, types
package = types.ModuleType("ViTTransferFunction")
package.__path__ = [sys.argv[1]]
sys.modules["ViTTransferFunction"] = package
from ViTTransferFunction.Logic.compute.server import main
main()
"""
_LAST_WORDS_BYTES = 4000
_PATIENCE_S = 2.0


class ComputeClient:
    """Starts the compute process, and talks to it.

    Args:
        python_executable: the Python that has PyTorch; the running one unless given.

    Attributes:
        pid: the process's number.
    """

    def __init__(self, python_executable: str | Path | None = None) -> None:
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (closed in `close`)
        self._process = subprocess.Popen(
            [str(python_executable or sys.executable), "-c", _BOOTSTRAP, str(Path(__file__).parents[2])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            # Where another program uses a core, OpenMP's default of spinning while it waits makes PyTorch many times slower.
            # NumPy's own threads spin as well; all large products are PyTorch's.
            env={"OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1", **os.environ},
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        self.pid = self._process.pid
        self._last_request = 0
        self._outgoing: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._incoming: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._write, self._read)]
        for thread in self._threads:
            thread.start()

    def request(self, request: Any) -> int:
        """Ask for something (`requests`); returns the request's number at once. Its arrays must not change until the reply."""
        self._last_request += 1
        self._outgoing.put(to_message(self._last_request, request))
        return self._last_request

    def cancel(self, numbers: Iterable[int]) -> None:
        """Give up the requests of these numbers. Each is still replied to: by `GivenUp`, if it was stopped in time."""
        self._outgoing.put(to_message(0, Cancel(tuple(numbers))))

    def replies(self) -> list[tuple[int, Any]]:
        """What has come since the last call, oldest first: the number of the request, and the reply (`requests`)."""
        # Where the host's event loop holds Python's lock while it idles, this lets the threads have their turn.
        time.sleep(0)
        received = []
        while not self._incoming.empty():
            received.append(from_message(self._incoming.get()))
        return received

    @property
    def alive(self) -> bool:
        """Whether the process runs and all that it said has been read."""
        return self._process.poll() is None or self._threads[1].is_alive() or not self._incoming.empty()

    def last_words(self) -> str:
        """The end of what the process wrote to its error stream: why it died, if it did."""
        self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, self._errors.tell() - _LAST_WORDS_BYTES))
        return self._errors.read().decode(errors="replace").strip()

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        self._outgoing.put(None)
        for thread in self._threads:
            thread.join(_PATIENCE_S)
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            _close(stream)

    def _write(self) -> None:
        assert self._process.stdin is not None
        try:
            while (message := self._outgoing.get()) is not None:
                write_message(self._process.stdin, message)  # type: ignore[arg-type]
        except OSError:
            return  # The process is gone, which `alive` tells.

    def _read(self) -> None:
        assert self._process.stdout is not None
        while (message := read_message(self._process.stdout)) is not None:  # type: ignore[arg-type]
            self._incoming.put(message)


def _close(stream: IO[bytes] | None) -> None:
    try:
        if stream is not None:
            stream.close()
    except OSError:
        pass  # What was still to be flushed has nobody left to read it.
