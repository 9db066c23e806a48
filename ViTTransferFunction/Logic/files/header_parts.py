"""What headers of several formats have: lines of text, and a part of the image in another file."""

from __future__ import annotations

from pathlib import Path

from ..core.system.errors import InputError
from ..core.system.regular_file import check_regular_file, mode_of


def named_file(header: Path, name: str) -> Path:
    """The file that a header names, which lies beside it unless the name says otherwise. Raises InputError: it is not there."""
    file = header.parent / name
    check_is_there(header, "voxels", file)
    return file


def check_is_there(path: Path, what: str, other: Path) -> None:
    """Raise InputError unless the other one of two files can be opened, which nobody has named: it has a part of the image."""
    if mode_of(other) is None:
        raise InputError(
            f"{path} has its {what} in another file, {other.name}, which is not there. Put both into one folder; on the app's "
            "page, open both at once."
        )
    check_regular_file(other)


def fields_of(header: bytes, separator: str) -> dict[str, str]:
    """What the lines `key separator value` of a header say, by key."""
    # Not `splitlines`, which also breaks lines at characters of Unicode that may stand in a name.
    lines = (line.partition(separator) for line in header.decode("utf-8", "surrogateescape").split("\n"))
    return {key.strip(): value.strip() for key, found, value in lines if found}
