"""Files as Windows has them: one that this process has open, or mapped into memory, can be neither removed nor replaced."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ViTTransferFunction.Logic.core.system.private_folder import LOCK

HELD = Path("/proc/self")
"""Where Linux tells what this process has open and mapped."""

NOT_NEEDED = os.name == "nt"
"""Windows refuses by itself."""


def as_on_windows(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Have the system refuse what Windows refuses, for the rest of a test; returns the list of what was refused.

    On Windows, which counts nothing, the list stays empty.
    """
    refused: list[str] = []
    if NOT_NEEDED:
        return refused
    for name in ("unlink", "remove", "rename", "replace"):
        monkeypatch.setattr(os, name, _strict(name, getattr(os, name), refused))
    return refused


def left_in(folder: Path) -> list[Path]:
    """What compute processes left there; Windows keeps the lock, and the folder around it, as long as this process has it."""
    if NOT_NEEDED:
        return [path for path in folder.rglob("*") if path.is_file() and path.name != LOCK]
    return list(folder.iterdir())


def _strict(name: str, does: Any, refused: list[str]) -> Any:
    def strict(*paths: Any, **options: Any) -> None:
        for path in paths:
            if _is_held(path, options.get("dir_fd")):
                refused.append(f"{name} {path}")
                raise PermissionError(13, "The process cannot access the file because it is being used", str(path))
        does(*paths, **options)

    return strict


def _is_held(path: Any, folder: int | None) -> bool:
    try:
        status = os.stat(path, dir_fd=folder, follow_symlinks=False)
    except FileNotFoundError:
        return False
    return (status.st_dev, status.st_ino) in {*_opened(), *_mapped()}


def _opened() -> Iterator[tuple[int, int]]:
    for descriptor in os.listdir(HELD / "fd"):  # noqa: PTH208
        try:
            status = os.fstat(int(descriptor))
        except OSError:
            continue  # That of the listing itself.
        yield status.st_dev, status.st_ino


def _mapped() -> Iterator[tuple[int, int]]:
    for line in (HELD / "maps").read_text(encoding="utf-8").splitlines():
        _, _, _, device, inode, *_ = line.split()
        major, minor = (int(part, 16) for part in device.split(":"))
        yield os.makedev(major, minor), int(inode)
