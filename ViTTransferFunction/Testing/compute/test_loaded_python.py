"""The tests' quick compute processes, which are forked: to those who start them they are what started ones are."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ViTTransferFunction.Testing.support.loaded_python import LoadedPython

if sys.platform != "linux":
    pytest.skip("they are forked on Linux only", allow_module_level=True)

SHOWS_ITSELF = """
import os, sys
loaded = [name for name in ("torch", "ViTTransferFunction.Logic") if name in sys.modules]
print(sys.argv[1:], os.getcwd(), os.environ["GIVEN"], os.getpid() == os.getpgid(0), sys.stdin.read(), loaded, flush=True)
print("trouble", file=sys.stderr, flush=True)
"""


@pytest.fixture(scope="module")
def python() -> Iterator[LoadedPython]:
    with LoadedPython() as python:
        yield python


def started(python: LoadedPython, program: str, folder: Path, *arguments: str) -> Any:
    """A process as `ComputeProcess` starts it; what it says of errors is in `errors.txt`."""
    with (folder / "errors.txt").open("wb") as errors:
        return python.popen(
            [sys.executable, "-c", program, *arguments],
            cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, bufsize=0,
            env={**os.environ, "GIVEN": "something"}, start_new_session=True,
        )  # fmt: skip


def test_a_forked_process_has_the_arguments_streams_folder_and_environment_that_it_is_given(
    python: LoadedPython, tmp_path: Path
) -> None:
    process = started(python, SHOWS_ITSELF, tmp_path, "a", "b")
    process.stdin.write(b"asked")
    process.stdin.close()
    said = process.stdout.read().decode()
    assert said == f"['a', 'b'] {tmp_path} something True asked ['torch']\n"
    assert process.wait(60.0) == 0
    assert (tmp_path / "errors.txt").read_text() == "trouble\n"


def test_a_forked_process_that_is_busy_is_waited_for_and_killed_with_its_group(python: LoadedPython, tmp_path: Path) -> None:
    process = started(python, "import time; time.sleep(600)", tmp_path)
    assert process.poll() is None
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.01)
    os.killpg(process.pid, 9)
    process.wait(60.0)
    assert process.poll() is not None
    assert process.stdout.read() == b""


def test_what_a_forked_process_fails_by_is_its_last_word(python: LoadedPython, tmp_path: Path) -> None:
    started(python, "raise KeyError('weights')", tmp_path).wait(60.0)
    assert (tmp_path / "errors.txt").read_text().splitlines()[-1] == "KeyError: 'weights'"
