"""What may be opened."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from ViTTransferFunction.Logic.core.system import regular_file
from ViTTransferFunction.Logic.core.system.atomic_file import check_writable, replacing
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.regular_file import check_regular_file, mode_of


@pytest.mark.parametrize("name", ["\udcff.nii.gz", "scans \udcff/scan.nrrd"])
def test_names_that_are_no_text_are_refused_for_reading_and_writing(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no text"):
        check_regular_file(tmp_path / name)
    with pytest.raises(InputError, match="no text"), replacing(tmp_path / name):
        pass
    assert not list(tmp_path.iterdir())


def on_windows(monkeypatch: pytest.MonkeyPatch, long_paths: bool | None, longest: int) -> None:
    """Pretend to be on a Windows that opens paths longer than `longest`, does not, or cannot be asked (None).

    Longer than on Windows itself they cannot be for a test that is to run there.
    """

    enabled = bool(long_paths)

    class AreEnabled:
        def __call__(self) -> int:
            # Windows answers by a byte; the other three of a number are left from something else.
            return int(enabled) if vars(self)["restype"] is ctypes.c_ubyte else 0x7FFF00 + enabled

    functions = {} if long_paths is None else {"RtlAreLongPathsEnabled": AreEnabled()}
    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(ntdll=SimpleNamespace(**functions)), raising=False)
    monkeypatch.setattr(regular_file, "LONGEST_ON_WINDOWS", longest)
    monkeypatch.setattr(sys, "platform", "win32")


def path_of(length: int, folder: Path, name: str = "scan.nrrd") -> Path:
    """A path of so many characters, in a new folder."""
    deep = folder
    while (room := length - len(str(deep / name))) > 0:
        deep /= "x" * (min(room, 101) - 1) if room != 102 else "x" * 50
    deep.mkdir(parents=True)
    assert len(str(deep / name)) == length
    return deep / name


@pytest.mark.parametrize("further", [0, 1])
@pytest.mark.parametrize("long_paths", [False, True, None])
def test_a_path_that_windows_does_not_open_is_told_from_one_with_nothing_there(
    further: int, long_paths: bool | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    longest = len(str(tmp_path)) + 60
    path = path_of(longest + further, tmp_path)
    path.write_text("voxels")
    assert mode_of(path)
    on_windows(monkeypatch, long_paths, longest)
    if further and not long_paths:
        with pytest.raises(InputError, match=f"{longest + 1} characters, and {longest} are the most"):
            check_regular_file(path)
    else:
        check_regular_file(path)


def test_an_output_whose_temporary_file_windows_could_not_open_is_refused_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    longest = len(str(tmp_path)) + 60
    path = path_of(longest, tmp_path, "a.nii")
    check_writable(path)
    on_windows(monkeypatch, False, longest)
    for attempt in (lambda: check_writable(path), lambda: replacing(path).__enter__()):
        with pytest.raises(InputError, match="too long a path"):
            attempt()


def test_of_a_path_that_is_far_too_long_for_windows_the_beginning_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    on_windows(monkeypatch, False, 259)
    with pytest.raises(InputError, match=r"^a.a.* is too long a path") as refused:
        mode_of(Path("a/" * 3000))
    assert len(str(refused.value)) < 400
