"""Programs in the place of the compute process."""

from __future__ import annotations

import ensurepip
import io
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[3]


def stub_executable(folder: Path, program: str) -> Path:
    """Something to start in the place of Python: it runs the given program, with the arguments that Python would have got.

    Args:
        folder: gets its files.
        program: Python.
    """
    if sys.platform == "win32":
        return _windows_executable(folder, program)
    (folder / "program.py").write_text(program)
    path = folder / "PythonSlicer"
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{folder}/program.py" "$@"\n')
    path.chmod(0o700)
    return path


def _windows_executable(folder: Path, program: str) -> Path:
    """As pip makes commands: a launcher that comes with every Python, the Python to start, and the program."""
    (wheel,) = Path(ensurepip.__file__).parent.glob("_bundled/pip-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        launcher = archive.read("pip/_vendor/distlib/t64.exe")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("__main__.py", program)
    path = folder / "PythonSlicer.exe"
    path.write_bytes(launcher + f'#!"{sys.executable}"\r\n'.encode() + packed.getvalue())
    return path


def one_reply_of_labels(shape: tuple[int, int, int]) -> str:
    """A program that says its number, and answers its first request by labels (K, J, I) uint8: 7 in the last slice, else 0."""
    return f"""
import os, sys
sys.path.insert(0, {str(ROOT)!r})
from pathlib import Path
import numpy as np
from ViTTransferFunction.Logic.compute.array_files import ArrayFiles
from ViTTransferFunction.Logic.compute.codec import to_message
from ViTTransferFunction.Logic.compute.messages import read_message, write_message
from ViTTransferFunction.Logic.compute.requests import Labels, Started
labels = np.zeros({shape}, np.uint8)
labels[-1] = 7
files = ArrayFiles(Path(sys.argv[-1]))
write_message(sys.stdout.buffer, to_message(0, Started(os.getpid())), files)
read_message(sys.stdin.buffer, files)
write_message(sys.stdout.buffer, to_message(1, Labels(labels, (0, 0, 0))), files)
sys.stdin.read()
"""
