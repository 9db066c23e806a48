"""Names of files: that every system takes, for what users call their volumes, classes and cases; and with an ending."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path

from .errors import InputError
from .regular_file import mode_of

_DEVICES_OF_WINDOWS = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}

LONGEST_NAME_BYTES = 200
"""Files on most disks have names of up to 255 bytes, and endings follow."""
_IN_NO_NAME = re.compile(r'[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069/\\:*?"<>|]')
"""Characters that some system takes in no file's name, or that have it read as another one."""
_LOOKS_LIKE_ENDING = re.compile(r"\.[A-Za-z][A-Za-z0-9]{1,3}")
"""Of another kind of file, such as .jpg or .webm. What else follows a dot is part of the name, as in 'liver 2.5' or 'No. 3'."""


def with_ending(path: Path, endings: Sequence[str]) -> Path:
    """The path with an ending of the kind of file that is written, added where the name has none.

    Args:
        path: as the user chose it.
        endings: of that kind, such as `(".mp4", ".gif")`, in lower case; the first one is added.

    Raises:
        InputError: the name ends as another kind of file does; or there is a file of the completed name, which the user did not
            choose to replace.
    """
    if path.suffix.lower() in endings:
        return path
    if _LOOKS_LIKE_ENDING.fullmatch(path.suffix):
        raise InputError(f"{path}: expected the name to end in {' or '.join(endings)}.")
    completed = path.with_name(path.name + endings[0])
    if mode_of(completed) is not None:
        raise InputError(f"{completed} is there already. Choose it by its whole name to replace it, or choose another name.")
    return completed


def file_stem(name: str) -> str:
    """A class's name as that of a file which no ending is looked for in; the beginning of one that is too long."""
    stem = "".join(character if _is_in_words(character) or character in "-_ " else "_" for character in name).strip()
    stem = stem.encode()[:LONGEST_NAME_BYTES].decode(errors="ignore").strip()
    return f"_{stem}" if not stem or is_device(stem) else stem


def _is_in_words(character: str) -> bool:
    """Whether it is a letter, a digit, or a mark on one, as vowels of Hindi and Thai are, and accents that stand alone."""
    return character.isalnum() or unicodedata.category(character).startswith("M")


def kept_name(name: str) -> str:
    """A volume's name as a file's that every system takes, an ending being added: the same wherever a file was called so.

    Others look for files beside a volume's by that name.
    """
    kept = _IN_NO_NAME.sub("_", name.encode(errors="replace")[:LONGEST_NAME_BYTES].decode(errors="ignore")).strip()
    return f"_{kept}" if kept.strip(".") == "" or is_device(kept) else kept


def is_device(name: str) -> bool:
    """Whether Windows takes a file's name for that of a device, as it does in every folder and with every ending."""
    # Windows takes a raised digit for the digit.
    return unicodedata.normalize("NFKC", name).partition(".")[0].strip().upper() in _DEVICES_OF_WINDOWS
