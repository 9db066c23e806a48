"""Starts and ends the compute process, and finds out why it died."""

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

# The package is created by hand, since its own file imports modules of the host program, which the process does not have.
# Files in the user's working folder must not be imported as libraries. -c puts the working folder first in sys.path, and so
# does an empty entry of PYTHONPATH, such as a launcher may leave. Therefore Python starts in an empty folder, removes it from
# sys.path, and only then changes to the user's folder, to which relative paths refer. (-I would avoid this, but hide the
# libraries of Slicer's Python; -P needs Python 3.11.)
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
"""Free space that is required in memory; a large volume and its label map take half of it."""
_LAST_WORDS_BYTES = 64_000
_FATAL, _WINDOWS_FATAL = "Fatal Python error: ", "Windows fatal exception: "
"""Prefixes of Python's message when a library stops the process; on Windows also of exceptions that the library handles."""
_LAUNCHER_S_LINE = re.compile(r"exit abnormally")
"""Message of the launcher that starts Slicer's Python; it follows if the process was killed, and does not say why."""
_PATIENCE_S = 0.3
"""Time in which the process may end by itself; it usually takes a hundredth of a second."""
_REMOVING_S, _RETRY_S = 1.0, 0.02


class ComputeProcess:
    """A Python process that runs `server.main`, and the launcher that started it, if any (Slicer's `PythonSlicer`).

    Args:
        python_executable: a Python with PyTorch; None: the running one.

    Attributes:
        requests: the process's standard input.
        replies: its standard output.
        folder: private to the user, for the arrays of requests and replies.
        own_pid: the process's own number, once it has sent it; until then None. A launcher has another number.

    Raises:
        InputError: the process cannot be started.
    """

    def __init__(self, python_executable: str | Path | None = None) -> None:
        executable = _executable(python_executable)
        self.own_pid: int | None = None
        self._private = _private_folder()
        self.folder = Path(self._private.name)
        # After the folder, which raises an InputError if there is no place for temporary files.
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (closed in `clean_up`)
        try:
            self._process = subprocess.Popen(
                [executable, "-c", _BOOTSTRAP, str(Path(__file__).parents[2]), _working_folder(), str(self.folder)],
                cwd=self.folder,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                # By default OpenMP's threads spin while they wait, which makes PyTorch many times slower if another program
                # uses a core. NumPy's threads spin as well, and are not needed: PyTorch computes all large products.
                env={"OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1", **os.environ},
                # Closing a buffered stream would wait for a thread that is writing to it.
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
        """The process's own number; until that is known, its launcher's."""
        return self.own_pid or self._process.pid

    @property
    def runs(self) -> bool:
        """Whether the process, or its launcher if there is one, is still running."""
        return self._process.poll() is None

    def last_words(self) -> str:
        """The line of the process's error stream that says why it died; "" if it wrote nothing.

        This is the last line, unless a library stopped the process. Then it is the line by which Python reports that, since the
        following ones only give Python's position; a preceding line with an exception of the library is added.
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
        """End the process and its launcher, whatever they are doing."""
        # The process ends when its input is closed; killing a launcher would leave its child running. The input is closed by a
        # thread, because closing blocks on Windows while another thread writes to a process that does not read.
        closing = threading.Thread(target=_close, args=(self.requests,), daemon=True)
        closing.start()
        closing.join(_PATIENCE_S)
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._kill()
            self._process.wait()

    def clean_up(self) -> None:
        """Close the streams and remove the folder, after the last read from `replies`."""
        _close(self.replies)
        _close(self._errors)
        self._private.cleanup()
        # Windows keeps the files of a killed process in use for a moment.
        give_up = time.monotonic() + _REMOVING_S
        while sys.platform == "win32" and self.folder.exists() and time.monotonic() < give_up:
            time.sleep(_RETRY_S)
            shutil.rmtree(self.folder, ignore_errors=True)

    def _kill(self) -> None:
        # Either process may end by itself in the meantime.
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
    """Index of the line by which Python reports that a library stopped the process; None if no library did."""
    # The first one, since Python may crash again while it lists the other threads, which continue meanwhile.
    errors = [index for index, line in enumerate(said) if line.startswith(_FATAL)]
    if errors:
        return errors[0]
    exceptions = [index for index, line in enumerate(said) if line.startswith(_WINDOWS_FATAL)]
    return exceptions[-1] if exceptions else None


def _executable(given: str | Path | None) -> str:
    """Absolute path of the Python to start; raises InputError if it does not exist."""
    executable = str(given or sys.executable or "")
    if not executable or not Path(executable).is_file():
        raise InputError(
            f"Python was not found{f' as {executable}' if executable else ''}, and nothing can be computed without it. The "
            "installation of Slicer, or of the app, is incomplete: install it again."
        )
    # Absolute, since it is started in another folder.
    return str(Path(executable).absolute())


def _working_folder() -> str:
    """The folder to which relative paths refer; if it was deleted, the one in which the process starts."""
    try:
        return str(Path.cwd())
    except OSError:
        return "."


def _private_folder() -> PrivateFolder:
    """A private folder, in a file system in memory if there is one with enough space, so that no voxel is written to a disk."""
    in_memory = IN_MEMORY.is_dir() and os.access(IN_MEMORY, os.W_OK) and shutil.disk_usage(IN_MEMORY).free >= ROOM_BYTES
    return private_folder(IN_MEMORY if in_memory else None)


def _close(stream: IO[bytes]) -> None:
    # Errors of flushing do not matter, since nobody reads the data any more.
    with suppress(OSError):
        stream.close()
