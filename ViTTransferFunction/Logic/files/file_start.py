"""The first bytes of files, which say what they are."""

from __future__ import annotations

from pathlib import Path

from ..core.system.regular_file import cannot_read, check_regular_file

LONGEST_HEADER = 1 << 20
"""Of an image, in bytes, but for segmentations of thousands of segments."""
DICOM_START_BYTES = 132


def is_dicom_start(start: bytes) -> bool:
    """Whether a file's first `DICOM_START_BYTES` are those of DICOM."""
    return start[128:] == b"DICM"


def read_start(path: Path, count: int = LONGEST_HEADER) -> bytes:
    """The file's first bytes: by default as many as hold all of a header.

    Raises:
        InputError: it is no ordinary file, or cannot be read.
    """
    check_regular_file(path)
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise cannot_read(path, error) from error
