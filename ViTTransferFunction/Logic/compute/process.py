"""The operating system's side of the compute process: how it is started, why it died, and how it ends."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, cast

from ..core.system.errors import InputError
from ..core.system.private_folder import PrivateFolder, private_folder

# The package is made by hand: its own file imports the host program's modules, which the process does not have.
# What lies in the user's working folder must not be taken for a library. -c puts the working folder in front of all others,
# and an empty entry of PYTHONPATH, such as a launcher may leave, names it as well: so Python starts in a folder that is empty,
# forgets it, and only then goes to the user's, to which relative paths refer. (-I would do the first, but hide from Slicer's
# Python where its own libraries are; -P came with Python 3.11.)
_BOOTSTRAP = """
import os, sys
package_folder, working_folder, private_folder = sys.argv[1:]
sys.path[:] = [folder for folder in sys.path if folder and os.path.realpath(folder) != os.path.realpath(private_folder)]
os.chdir(working_folder)
import types
package = types.ModuleType("ViTTransferFunction")
package.__path__ = [package_folder]
sys.modules["ViTTransferFunction"] = package
from ViTTransferFunction.Logic.compute.server import main
main(private_folder)
"""
IN_MEMORY = Path("/dev/shm")
"""Linux's file system in memory."""
ROOM_BYTES = 2 * 2**30
"""A large volume and its label map take half of that."""
_LAST_WORDS_BYTES = 64_000
_FATAL, _WINDOWS_FATAL = "Fatal Python error: ", "Windows fatal exception: "
"""How Python begins to say where it was when a library stopped the process; on Windows also of exceptions that a library lives
through."""
_LAUNCHER_S_LINE = re.compile(r"exit abnormally")
"""Slicer's Python is started by a launcher, which has the last word where the process was killed, and does not know why."""
_PATIENCE_S = 0.3
"""How long the process may take to end by itself; most often it needs a hundredth of a second."""
_REMOVING_S, _RETRY_S = 1.0, 0.02


class ComputeProcess:
    """A Python that runs `server.main`, and maybe a launcher that started it, as Slicer's `PythonSlicer` does.

    Args:
        python_executable: the Python that has PyTorch; the running one unless given.

    Attributes:
        requests: the process's standard input.
        replies: its standard output.
        folder: private to the user, for the arrays of both.
        own_pid: the number that the process says is its own; None until it did. A launcher has another one.

    Raises:
        InputError: it cannot be started.
    """

    def __init__(self, python_executable: str | Path | None = None) -> None:
        executable = _executable(python_executable)
        self.own_pid: int | None = None
        self._private = _private_folder()
        self.folder = Path(self._private.name)
        # After the folder, which tells it in words where no place for temporary files is to be had.
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (closed in `clean_up`)
        try:
            self._process = subprocess.Popen(
                [executable, "-c", _BOOTSTRAP, str(Path(__file__).parents[2]), _working_folder(), str(self.folder)],
                cwd=self.folder,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                # Where another program uses a core, OpenMP's default of spinning while it waits makes PyTorch many times
                # slower. NumPy's own threads spin as well; all large products are PyTorch's.
                env={"OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1", **os.environ},
                # Closing a buffered stream would wait for whoever is writing to it.
                bufsize=0,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
                # A group of its own, so that launcher and process can be ended together.
                start_new_session=True,
            )
        except OSError as error:
            self._errors.close()
            self._private.cleanup()
            raise InputError(
                f"Computing could not be started with {executable}: {error.strerror or error}. "
                "Restart Slicer or the app; if that does not help, install it again."
            ) from error
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self.requests: IO[bytes] = self._process.stdin
        self.replies: IO[bytes] = io.BufferedReader(cast(io.RawIOBase, self._process.stdout))

    @property
    def pid(self) -> int:
        """The process's own number; its launcher's until it is known."""
        return self.own_pid or self._process.pid

    @property
    def runs(self) -> bool:
        """Whether the process, or its launcher, has not ended yet."""
        return self._process.poll() is None

    def last_words(self) -> str:
        """The last line that the process wrote to its error stream: why it died, if it knew; "" where it said nothing.

        Where a library stopped it, the lines that follow say where Python was, and what the library said goes before.
        """
        self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, self._errors.tell() - _LAST_WORDS_BYTES))
        lines = self._errors.read().decode(errors="replace").splitlines()
        said = [line.strip() for line in lines if line.strip() and not _LAUNCHER_S_LINE.search(line)]
        fatal = _line_of_the_fatal(said)
        if fatal is not None:
            thrown = [line for line in said[max(0, fatal - 1) : fatal] if line.startswith("what():")]
            return "; ".join([*thrown, said[fatal]])
        return said[-1] if said else ""

    def end(self) -> None:
        """End the process, whatever it is doing, and its launcher."""
        # It ends itself when its input does. Killing a launcher first would leave what it had launched. By a thread: while
        # another one still writes to a process that does not read, Windows closes nothing.
        closing = threading.Thread(target=_close, args=(self.requests,), daemon=True)
        closing.start()
        closing.join(_PATIENCE_S)
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._kill()
            self._process.wait()

    def clean_up(self) -> None:
        """Close what is left, once nobody reads it any more."""
        _close(self.replies)
        _close(self._errors)
        self._private.cleanup()
        # Windows keeps the files of a process that was killed for a moment more.
        give_up = time.monotonic() + _REMOVING_S
        while sys.platform == "win32" and self.folder.exists() and time.monotonic() < give_up:
            time.sleep(_RETRY_S)
            shutil.rmtree(self.folder, ignore_errors=True)

    def _kill(self) -> None:
        # Each may end by itself in the meantime.
        if sys.platform == "win32":
            if self.own_pid is not None:
                with suppress(OSError):
                    os.kill(self.own_pid, signal.SIGTERM)
            with suppress(OSError):
                self._process.kill()
        else:
            with suppress(OSError):
                os.killpg(self._process.pid, signal.SIGKILL)


def _line_of_the_fatal(said: list[str]) -> int | None:
    """Which line says what stopped the process; None where a library did not."""
    # The first one: Python may crash once more while it says where the other threads are, since they go on meanwhile.
    errors = [index for index, line in enumerate(said) if line.startswith(_FATAL)]
    if errors:
        return errors[0]
    exceptions = [index for index, line in enumerate(said) if line.startswith(_WINDOWS_FATAL)]
    return exceptions[-1] if exceptions else None


def _executable(given: str | Path | None) -> str:
    """A Python that is there. Raises InputError."""
    executable = str(given or sys.executable or "")
    if not executable or not Path(executable).is_file():
        raise InputError(
            f"Python was not found{f' as {executable}' if executable else ''}, and nothing can be computed without it. The "
            "installation of Slicer, or of the app, is incomplete: install it again."
        )
    # It is started from another folder.
    return str(Path(executable).absolute())


def _working_folder() -> str:
    """Where relative paths begin; where it was deleted, wherever the process starts."""
    try:
        return str(Path.cwd())
    except OSError:
        return "."


def _private_folder() -> PrivateFolder:
    """In memory, where the system has a file system for that and there is room: no voxel is then written to a disk."""
    in_memory = IN_MEMORY.is_dir() and os.access(IN_MEMORY, os.W_OK) and shutil.disk_usage(IN_MEMORY).free >= ROOM_BYTES
    return private_folder(IN_MEMORY if in_memory else None)


def _close(stream: IO[bytes]) -> None:
    # What was still to be flushed has nobody left to read it.
    with suppress(OSError):
        stream.close()
