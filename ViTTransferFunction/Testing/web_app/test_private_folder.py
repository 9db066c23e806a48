"""Nothing is left of the files that are on their way between browser and scene."""

from __future__ import annotations

import atexit
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.core.progress import no_progress
from ViTTransferFunction.WebApp.private_folder import private_folder
from ViTTransferFunction.WebApp.routes import _as_it_is


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


def test_what_is_sent_as_it_is_is_not_renamed_while_a_virus_scanner_looks_at_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path, target: Path) -> None:
        raise PermissionError(13, "The process cannot access the file", str(path))

    for name in ("replace", "rename"):
        monkeypatch.setattr(Path, name, refused)
    (tmp_path / "staged").write_bytes(b"points")
    _as_it_is(tmp_path / "staged", tmp_path / "scan.annotations.json", no_progress)
    assert (tmp_path / "scan.annotations.json").read_bytes() == b"points"
