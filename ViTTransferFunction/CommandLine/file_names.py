"""Names of files that every system takes, for what users call their classes and cases."""

from __future__ import annotations

_DEVICES_OF_WINDOWS = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}


def file_stem(name: str) -> str:
    """A class's name as a file name that every platform takes."""
    stem = "".join(character if character.isalnum() or character in "-_ " else "_" for character in name).strip()
    return f"_{stem}" if not stem or is_device(stem) else stem


def is_device(name: str) -> bool:
    """Whether Windows takes a file's name for that of a device, as it does in every folder and with every ending."""
    return name.partition(".")[0].strip().upper() in _DEVICES_OF_WINDOWS
