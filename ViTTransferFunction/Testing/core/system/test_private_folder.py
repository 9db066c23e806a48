"""Nothing is left of files that are on their way, and nothing of others' goes."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ViTTransferFunction.Logic.core.system import private_folder as module
from ViTTransferFunction.Logic.core.system.private_folder import LOCK, YOUNG_S, private_folder


@pytest.fixture(autouse=True)
def folder_for_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def test_a_folder_goes_with_all_that_is_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atexit, "register", lambda *_, **__: pytest.fail("nothing is left"))
    with private_folder() as folder:
        Path(folder, "slices").mkdir()
        Path(folder, "slices", "1.dcm").write_bytes(b"voxels")
    assert not Path(folder).exists()


def test_a_file_that_windows_does_not_remove_while_it_is_open_goes_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    unlink, opened = os.unlink, {"scan.mrb"}
    at_the_end: list[Callable[[], None]] = []

    def refused(path: Any, **options: Any) -> None:
        if Path(path).name in opened:
            raise PermissionError(13, "The process cannot access the file", str(path))
        unlink(path, **options)

    monkeypatch.setattr(os, "unlink", refused)
    monkeypatch.setattr(atexit, "register", lambda work, *args, **options: at_the_end.append(lambda: work(*args, **options)))
    with private_folder() as folder:
        for name in ("scan.mrb", "scan.nrrd"):
            Path(folder, name).write_bytes(b"voxels")
    assert [entry.name for entry in Path(folder).iterdir()] == ["scan.mrb"]
    opened.clear()
    (remove,) = at_the_end
    remove()
    assert not Path(folder).exists()


OTHER_PROGRAM = """
import sys
from pathlib import Path
from ViTTransferFunction.Logic.core.system.private_folder import private_folder
with private_folder(Path(sys.argv[1])) as folder:
    Path(folder, "scan.nrrd").write_bytes(b"voxels")
    print(folder, flush=True)
    sys.stdin.read()
"""


def grow_old(folder: Path) -> None:
    """Have a folder be one that was made a while ago."""
    then = time.time() - 2 * YOUNG_S
    os.utime(folder / LOCK, (then, then))


def start_again(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder as a program does that has just started."""
    monkeypatch.setattr(module, "_tidied", set())
    with private_folder(place):
        pass


def test_what_a_killed_program_left_goes_and_what_a_running_one_has_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = subprocess.Popen(
        [sys.executable, "-c", OTHER_PROGRAM, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    said: Any = other.stdout
    folder = Path(said.readline().strip())
    grow_old(folder)
    start_again(tmp_path, monkeypatch)
    assert (folder / "scan.nrrd").exists()
    other.kill()
    other.communicate()
    assert (folder / "scan.nrrd").exists()
    start_again(tmp_path, monkeypatch)
    assert list(tmp_path.iterdir()) == []


def left(place: Path, name: str = "vittf-0123abcd") -> Path:
    """A folder as a killed program leaves it."""
    folder = place / name
    folder.mkdir()
    for file in (LOCK, "scan.nrrd"):
        (folder / file).touch()
    grow_old(folder)
    return folder


@pytest.mark.parametrize("name", ["vittf-0123abcd.d", "vittf-attack-weights-1", "tmp01234567", "Vittf-76543210"])
def test_folders_of_other_names_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    folder, ours = left(tmp_path, name), left(tmp_path)
    start_again(tmp_path, monkeypatch)
    assert ((folder / "scan.nrrd").exists(), ours.exists()) == (True, False)


def test_what_may_just_be_made_or_has_no_lock_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    young, without = left(tmp_path), left(tmp_path, "vittf-without1")
    os.utime(young / LOCK)
    (without / LOCK).unlink()
    start_again(tmp_path, monkeypatch)
    assert (young / "scan.nrrd").exists()
    assert (without / "scan.nrrd").exists()


def test_where_the_disk_knows_no_locks_nothing_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = left(tmp_path)
    monkeypatch.setattr(module, "take_lock", lambda _: None)
    start_again(tmp_path, monkeypatch)
    assert folder.exists()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="there, the folder is the user's own")
def test_what_another_user_has_put_there_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = left(tmp_path, "elsewhere")
    (tmp_path / "vittf-0123abcd").symlink_to(elsewhere, target_is_directory=True)
    start_again(tmp_path, monkeypatch)
    assert (elsewhere / "scan.nrrd").exists()
    folder = left(tmp_path, "vittf-ofothers")
    monkeypatch.setattr(os, "getuid", lambda: -2)
    start_again(tmp_path, monkeypatch)
    assert folder.exists()


def test_it_is_looked_in_the_folder_of_temporary_files_also_where_the_first_is_made_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_memory = tmp_path / "memory"
    in_memory.mkdir()
    folders = left(tmp_path), left(in_memory)
    start_again(in_memory, monkeypatch)
    assert not any(folder.exists() for folder in folders)


def test_a_process_looks_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start_again(tmp_path, monkeypatch)
    folder = left(tmp_path)
    with private_folder(tmp_path):
        assert folder.exists()
