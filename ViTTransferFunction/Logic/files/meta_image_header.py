"""Headers of MetaImage, after the documentation of MetaIO."""

from __future__ import annotations

import re
from pathlib import Path

from ..core.system.errors import InputError, shown
from .header_parts import fields_of, named_file
from .length_units import check_units
from .stored_voxels import StoredVoxels

_DATA_FILE = re.compile(rb"^[ \t]*ElementDataFile[ \t]*[=:][ \t]*([^\r\n]*)\r?\n", re.MULTILINE)


def locate(path: Path, start: bytes) -> StoredVoxels:
    """Where the voxels of a file are, whose first bytes are given. Raises InputError: its header cannot be used."""
    last_line = _DATA_FILE.search(start + b"\n")
    if last_line is None:
        raise InputError(f"{path} is no MetaImage: its header has no line 'ElementDataFile = …'.")
    fields = fields_of(start[: last_line.start()], "=")
    name = _data_file(last_line)
    # MetaIO hangs with fewer, and its tables have room for ten.
    if not re.fullmatch(r"[1-9]|10", fields.get("NDims", "3")):
        raise InputError(f"{path} says that it has {shown(fields['NDims'])} dimensions; expected 3.")
    if fields.get("BinaryData", "True")[:1] not in ("T", "t", "1"):
        raise InputError(f"{path} holds its voxels as text; save it with binary ones.")
    check_units(path, [fields.get("DistanceUnits", "")])
    compressed = fields.get("CompressedData", "False")[:1] in ("T", "t", "1")
    header_size = fields.get("HeaderSize", "0")
    if name.lower() == "local":
        if header_size not in ("0", "-1"):
            raise InputError(f"{path}: 'HeaderSize = {header_size}' contradicts 'ElementDataFile = LOCAL'; save it again.")
        return StoredVoxels(path, last_line.end(), compressed)
    # MetaIO makes a number of the part behind %, whatever it is, and crashes.
    if "%" in name or name.split(maxsplit=1)[:1] == ["LIST"] or not name:
        raise InputError(f"{path} names its voxels' files by '{name}'; expected the name of one file. Save it as .mha.")
    if not re.fullmatch(r"-1|\d{1,18}", header_size) or (compressed and header_size != "0"):
        raise InputError(f"{path}: 'HeaderSize = {header_size}' cannot be used; save it again.")
    voxels = named_file(path, name)
    return StoredVoxels(voxels, None if header_size == "-1" else int(header_size), compressed)


def named_voxels(start: bytes) -> str | None:
    """What a header says where the voxels are, as it is written; None: in the file itself. Of a list, only its beginning."""
    last_line = _DATA_FILE.search(start + b"\n")
    name = _data_file(last_line) if last_line else "local"
    return None if name.lower() == "local" else name


def says_spacing(start: bytes) -> bool:
    """Whether a header says how far apart the voxels are."""
    return not {"ElementSpacing", "ElementSize"}.isdisjoint(fields_of(start, "="))


def says_sides(path: Path, start: bytes) -> bool:
    """Whether the header of a file says which sides of the patient its axes lead to."""
    return not {"TransformMatrix", "Rotation", "Orientation"}.isdisjoint(fields_of(start, "="))


def _data_file(last_line: re.Match[bytes]) -> str:
    return last_line[1].decode("utf-8", "surrogateescape").strip()
