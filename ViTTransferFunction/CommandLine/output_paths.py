"""Refusing, before anything is computed, to write over what is read, or over what is written as well.

Names are compared as the least particular file system would: without regard to case, to the form of accents, and to links.
"""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

from ViTTransferFunction.Logic.core.system.atomic_file import check_writable
from ViTTransferFunction.Logic.core.system.errors import InputError

Key: TypeAlias = "Path | tuple[int, int]"
"""Of a file: its name, or its device and number there."""


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
    check_apart(outputs, inputs)


def check_apart(outputs: Mapping[str, Path], inputs: Mapping[str, Iterable[Path]]) -> None:
    """Raise InputError where an output is an input or another output; the arguments are those of `check_outputs`."""
    given = {key: (name, file) for name, files in inputs.items() for file in files for key in _keys(file)}
    made: dict[Key, str] = {}
    for name, path in outputs.items():
        for key in _keys(path):
            if key in given:
                source, file = given[key]
                raise InputError(f"{path}: {name} would be written over {source} ({file}). Choose another name.")
            if key in made:
                raise _over_another(name, made[key], outputs)
            made[key] = name
    for name, path in outputs.items():
        for folder in _name_key(path).parents:
            if folder in made:
                raise _over_another(name, made[folder], outputs)


def _over_another(name: str, other: str, outputs: Mapping[str, Path]) -> InputError:
    return InputError(
        f"{outputs[name]}: {name} would be written over {other} ({outputs[other]}). Give one of them another name."
    )


def _keys(path: Path) -> list[Key]:
    """Keys of which two paths share one if they may be one file: by name, and where there is a file, by that."""
    keys: list[Key] = [_name_key(path)]
    try:
        # Knows hard links as well, and what the file system itself thinks of case.
        status = path.stat()
    except OSError:
        return keys  # It is not there yet.
    # Some disks number no files, on Windows: each would be taken for the other.
    return [*keys, (status.st_dev, status.st_ino)] if status.st_ino else keys


def _name_key(path: Path) -> Path:
    name = unicodedata.normalize("NFC", os.path.realpath(path)).casefold()
    # Of `s.nii` and `s.nii.gz` side by side, programs that build on ITK read the one for the other.
    return Path(name.removesuffix(".gz") if name.endswith(".nii.gz") else name)
