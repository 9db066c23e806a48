"""Memory that was freed goes back to the system."""

from __future__ import annotations

import ctypes
import sys

import numpy as np
import psutil
import pytest

from ViTTransferFunction.Logic.core.system.freed_memory import give_back_freed_memory

BLOCK_BYTES, BLOCKS = 100_000, 1000
"""Blocks so small that the C library does not ask the system for each, and so many that nothing else matters."""


@pytest.mark.skipif(
    sys.platform != "linux" or not hasattr(ctypes.CDLL(None), "malloc_trim"),
    reason="only glibc keeps memory that can be had back",
)
def test_freed_memory_goes_back_though_a_block_in_use_lies_behind_it() -> None:
    blocks = [np.ones(BLOCK_BYTES, dtype=np.uint8) for _ in range(BLOCKS)]
    held = psutil.Process().memory_info().rss
    del blocks[:-1]
    give_back_freed_memory()
    assert held - psutil.Process().memory_info().rss > 0.8 * BLOCK_BYTES * BLOCKS
    assert blocks[0].all()


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_where_the_c_library_cannot_nothing_happens(monkeypatch: pytest.MonkeyPatch, platform: str) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    give_back_freed_memory()
