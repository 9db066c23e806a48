"""Names of files: that every system takes, for what users call their classes and cases; and beside another file."""

from __future__ import annotations

from pathlib import Path

_DEVICES_OF_WINDOWS = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}


LONGEST_NAME_BYTES = 200
"""Files on most disks have names of up to 255 bytes, and endings follow."""


def file_stem(name: str) -> str:
    """A class's name as a file name that every platform takes; the beginning of one that is too long."""
    stem = "".join(character if character.isalnum() or character in "-_ " else "_" for character in name).strip()
    stem = stem.encode()[:LONGEST_NAME_BYTES].decode(errors="ignore").strip()
    return f"_{stem}" if not stem or is_device(stem) else stem


def is_device(name: str) -> bool:
    """Whether Windows takes a file's name for that of a device, as it does in every folder and with every ending."""
    return name.partition(".")[0].strip().upper() in _DEVICES_OF_WINDOWS


def rendering_path(path: Path) -> Path:
    """Where the 3D rendering lies, by the path of the slice picture."""
    return path.with_name(f"{path.stem}_3d{path.suffix}")
