"""The files of structures that are saved nowhere else, by themselves; with the app and the panel, beside these."""

from __future__ import annotations

import gc
import os
import shutil
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.file_lock import take_lock
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files import unsaved_files
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
    here, elsewhere = two_of_one_scan()
    here.write([], "", "")
    shutil.rmtree(a_cache_of_its_own)
    here.write([], "", "")
    assert elsewhere.latest_left(lambda _, error: pytest.fail(str(error))) is None
    here.close()


def test_points_are_offered_where_another_program_looks_at_them_at_the_same_moment(
    a_cache_of_its_own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, here = two_of_one_scan()
    left.write([], "", "")
    left.close()
    (lock,) = (a_cache_of_its_own / "unsaved").glob("*.lock")
    others = os.open(lock, os.O_RDWR)
    assert take_lock(others)
    monkeypatch.setattr(unsaved_files.time, "sleep", lambda _: os.close(others))
    assert here.latest_left(lambda _, error: pytest.fail(str(error))) is not None


def test_a_file_that_its_program_removes_at_that_moment_is_none_that_cannot_be_used(
    a_cache_of_its_own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there, here = two_of_one_scan()
    there.write([], "", "")

    def written_to(path: Path) -> bool:
        there.remove()
        there.close()
        return False

    monkeypatch.setattr(unsaved_files, "_is_written_to", written_to)
    assert here.latest_left(lambda _, error: pytest.fail(str(error))) is None


def two_of_one_scan() -> tuple[UnsavedFile, UnsavedFile]:
    """The files of two programs that have opened the same scan."""
    array, geometry = np.arange(8, dtype=np.float32).reshape(2, 2, 2), Geometry((2, 2, 2), np.eye(4))
    return UnsavedFile(array, geometry), UnsavedFile(array, geometry)
