"""The files of structures that are saved nowhere else, by themselves; with the app and the panel, beside these."""

from __future__ import annotations

import gc
import shutil
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest

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


@pytest.mark.skipif(sys.platform == "win32", reason="Windows removes no folder with an open file in it")
def test_who_goes_on_after_the_cache_folder_was_removed_is_not_taken_for_gone(a_cache_of_its_own: Path) -> None:
    array, geometry = np.arange(8, dtype=np.float32).reshape(2, 2, 2), Geometry((2, 2, 2), np.eye(4))
    here, elsewhere = UnsavedFile(array, geometry), UnsavedFile(array, geometry)
    here.write([], "", "")
    shutil.rmtree(a_cache_of_its_own)
    here.write([], "", "")
    assert elsewhere.latest_left(lambda _, error: pytest.fail(str(error))) is None
    here.close()
