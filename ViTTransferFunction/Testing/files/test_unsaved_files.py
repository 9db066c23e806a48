"""The files of structures that are saved nowhere else, by themselves; with the app and the panel, beside these."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.unsaved_files import UnsavedFile


def test_a_scan_that_is_known_by_its_name_is_no_longer_held_in_memory(a_cache_of_its_own: Path) -> None:
    array = np.arange(8).reshape(2, 2, 2).copy()
    held = weakref.ref(array)
    file = UnsavedFile(array, Geometry((2, 2, 2), np.eye(4)))
    del array
    assert file.latest_left(lambda _, error: None) is None
    gc.collect()
    assert held() is None
    file.write([], "", "")
    assert list((a_cache_of_its_own / "unsaved").glob("*.annotations.json"))
    file.close()
