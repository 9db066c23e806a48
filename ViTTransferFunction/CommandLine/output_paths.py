"""Refusing, before anything is computed, to write over what is read, or over what is written as well.

Names are compared as the least particular file system would: without regard to case, to the form of accents, and to links.
"""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path

from ViTTransferFunction.Logic.core.atomic_file import check_writable
from ViTTransferFunction.Logic.core.errors import InputError


def check_outputs(outputs: Mapping[str, Path], inputs: Mapping[str, Iterable[Path]]) -> None:
    """Check that every output can be written, and is neither an input nor another output.

    Args:
        outputs: what each is, in the user's words, and the file.
        inputs: what each is, in the user's words, and the files that it is read from.

    Raises:
        InputError: one cannot be written, or would be written over another.
    """
    for path in outputs.values():
        check_writable(path)
    names = list(outputs)
    for index, name in enumerate(names):
        path = outputs[name]
        for source, files in inputs.items():
            for file in files:
                if _are_one(path, file):
                    raise InputError(f"{path}: {name} would be written over {source} ({file}). Choose another name.")
        for other in names[:index]:
            if _are_one(path, outputs[other]) or _holds(path, outputs[other]) or _holds(outputs[other], path):
                raise InputError(
                    f"{path}: {name} would be written over {other} ({outputs[other]}). Give one of them another name."
                )


def _are_one(first: Path, second: Path) -> bool:
    try:
        # Knows hard links as well, and what the file system itself thinks of case.
        if first.samefile(second):
            return True
    except OSError:
        pass  # One of them is not there yet.
    return _key(first) == _key(second)


def _holds(folder: Path, file: Path) -> bool:
    """Whether one output's name is that of a folder in which the other lies."""
    return _key(folder) in _key(file).parents


def _key(path: Path) -> Path:
    """A path that is equal for paths that may be one file."""
    name = unicodedata.normalize("NFC", os.path.realpath(path)).casefold()
    # Of `s.nii` and `s.nii.gz` side by side, programs that build on ITK read the one for the other.
    return Path(name.removesuffix(".gz") if name.endswith(".nii.gz") else name)
