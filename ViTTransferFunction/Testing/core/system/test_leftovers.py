"""Temporary files of processes that were killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.system.atomic_file import ABANDONED_S, remove_leftovers, replacing

KILLED = """
import os, signal, sys
from pathlib import Path
from ViTTransferFunction.Logic.core.system.atomic_file import replacing

with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))
"""


def killed_while_it_wrote(path: Path, hours_ago: float = 0.0) -> Path:
    """The temporary file that a process leaves which is killed while it writes a file."""
    before = {*path.parent.iterdir()}
    subprocess.run([sys.executable, "-c", KILLED, path], check=False, cwd=Path(__file__).parents[4])
    (left,) = {*path.parent.iterdir()} - before
    changed_s = time.time() - 3600.0 * hours_ago
    os.utime(left, (changed_s, changed_s))
    return left


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_what_a_killed_process_was_writing_is_removed_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "a.seg.nrrd").write_text("whole")
    killed_while_it_wrote(tmp_path / "b.seg.nrrd")
    (tmp_path / ".writing-notes.txt").write_text("the user's own")
    (tmp_path / ".writing-0123abcd").mkdir()

    remove_leftovers(tmp_path)

    assert names_in(tmp_path) == {"a.seg.nrrd", ".writing-notes.txt", ".writing-0123abcd"}


def test_writing_to_a_folder_removes_what_was_left_there_a_day_ago_and_no_file_that_may_still_be_written(
    tmp_path: Path,
) -> None:
    killed_while_it_wrote(tmp_path / "old.seg.nrrd", hours_ago=25.0)
    recent = killed_while_it_wrote(tmp_path / "recent.nii.gz", hours_ago=23.0)
    assert 23.0 * 3600.0 < ABANDONED_S < 25.0 * 3600.0

    with replacing(tmp_path / "new.json") as temporary:
        temporary.write_text("{}")

    assert names_in(tmp_path) == {"new.json", recent.name}


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="Windows tells users apart in another way")
def test_what_another_user_was_writing_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left = killed_while_it_wrote(tmp_path / "theirs.nrrd", hours_ago=25.0)
    monkeypatch.setattr(os, "getuid", lambda: tmp_path.stat().st_uid + 1)

    remove_leftovers(tmp_path)

    assert left.exists()


def test_a_folder_that_is_not_there_has_no_leftovers(tmp_path: Path) -> None:
    remove_leftovers(tmp_path / "nowhere")
