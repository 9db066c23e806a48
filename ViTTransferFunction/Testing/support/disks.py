"""Disks that are as full as a test wants them to be."""

from __future__ import annotations

import shutil
from typing import NamedTuple

import pytest


class _Usage(NamedTuple):
    total: int
    used: int
    free: int


def set_free_space(monkeypatch: pytest.MonkeyPatch, free_bytes: int, total_bytes: int = 10**12) -> None:
    """For the rest of the test, every disk reports `free_bytes` free of `total_bytes`."""
    usage = _Usage(total_bytes, total_bytes - free_bytes, free_bytes)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
