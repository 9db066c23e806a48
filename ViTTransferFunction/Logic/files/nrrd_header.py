"""Headers of NRRD, after the definition of the format, version 5, of Teem."""

from __future__ import annotations

import re
from pathlib import Path

from ..core.system.errors import InputError
from .file_start import LONGEST_HEADER, read_start
from .header_parts import fields_of, named_file
from .length_units import check_units
from .stored_voxels import StoredVoxels

_END = re.compile(rb"\r?\n\r?\n")
_LONGEST = 1 << 26
"""Of thousands of segments, each has some three hundred bytes beside its name."""
_LONGEST_VALUE = 500
"""Teem writes what it complains of, which may be a whole field, into room for a thousand characters, and crashes."""
_PATIENT_SPACE = re.compile(r"(RAS|LAS|LPS|(right|left)-(anterior|posterior)-superior)(T|-time)?", re.IGNORECASE)
_TURNED_WITH_TIME = re.compile(r"(RAS|LAS)T|(right|left)-anterior-superior-time", re.IGNORECASE)
"""Spaces that ITK, and so Slicer, takes for left-posterior-superior."""


def locate(path: Path, start: bytes) -> StoredVoxels | None:
    """Where the voxels of a file are, whose first bytes are given; None: Teem itself notices what is missing.

    Raises:
        InputError: the header cannot be used.
    """
    if not start.startswith(b"NRRD"):
        raise InputError(f"{path} cannot be read as an image: it is no NRRD file, which would begin with the letters NRRD.")
    end = _END.search(start)
    if end is None and len(start) == LONGEST_HEADER:
        start = read_start(path, _LONGEST)
        end = _END.search(start)
    fields = _voxel_fields(start)
    for field, value in fields.items():
        if len(value) > _LONGEST_VALUE and field not in ("content", "datafile"):
            raise InputError(f"{path} is damaged: its header has {len(value)} characters for {field[:40]!r}. Save it again.")
    for field in ("spaceunits", "units"):
        check_units(path, re.findall('"([^"]*)"', fields.get(field, "")))
    space = fields.get("space", "")
    if _TURNED_WITH_TIME.fullmatch(space):
        raise InputError(
            f"{path} lies in the space '{space}', whose sides would be exchanged; expected one without time, such as "
            "'right-anterior-superior'. Save the time point alone."
        )
    name = fields.get("datafile")
    if name is not None:
        # Teem takes a minus sign for the standard input.
        if name == "-" or "%" in name or name.split(maxsplit=1)[:1] == ["LIST"]:
            raise InputError(f"{path} names its voxels' files by '{name}'; expected the name of one file. Save it as .nrrd.")
        voxels, first = named_file(path, name), 0
    else:
        if end is None:
            raise InputError(f"{path} is cut off: its header does not end. Copy or save it again.")
        voxels, first = path, end.end()
    encoding = fields.get("encoding", "").lower()
    # Teem crashes on what is no text after all.
    if encoding in ("ascii", "text", "txt", "hex"):
        raise InputError(f"{path} holds its voxels as text; save it with binary ones.")
    if encoding in ("bzip2", "bz2"):
        raise InputError(f"{path} holds its voxels compressed by bzip2; expected gzip, or none. Save it with that.")
    plain_or_gzip = {"raw": False, "gzip": True, "gz": True}.get(encoding)
    # Teem itself notices what other encodings lack, and what has been put before the voxels is its to skip.
    if plain_or_gzip is None or {fields.get("lineskip", "0"), fields.get("byteskip", "0")} != {"0"}:
        return None
    return StoredVoxels(voxels, first, plain_or_gzip)


def named_voxels(path: Path) -> str | None:
    """What the header of a file says where its voxels are, as it is written; None: in the file itself."""
    return _voxel_fields(read_start(path, _LONGEST)).get("datafile")


def says_spacing(start: bytes) -> bool:
    """Whether a header says how far apart the voxels are along three axes.

    Joined slices have a spacing that is no number, and so have axes that are none of space.
    """
    fields = _voxel_fields(start)
    numbers = [number for number in fields.get("spacings", "").split() if re.search(r"\d", number)]
    return len(numbers) >= 3 or bool(re.search(r"\d", fields.get("spacedirections", "")))


def says_sides(path: Path, start: bytes) -> bool:
    """Whether the header of a file says which sides of the patient its axes lead to."""
    return bool(_PATIENT_SPACE.fullmatch(_voxel_fields(start).get("space", "")))


def _voxel_fields(start: bytes) -> dict[str, str]:
    """What a header says of the voxels: values by field, in lower case and without spaces."""
    end = _END.search(start)
    lines = fields_of(start[: end.start() if end else None], ":")
    # A value that begins with = is a key's, which says nothing about the voxels, and may have any length.
    return {field.lower().replace(" ", ""): value for field, value in lines.items() if not value.startswith("=")}
