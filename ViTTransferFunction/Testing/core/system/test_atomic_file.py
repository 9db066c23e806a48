"""Files that are there whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.system import atomic_file
from ViTTransferFunction.Logic.core.system.atomic_file import check_writable, replacing
from ViTTransferFunction.Logic.core.system.errors import InputError

PIPES = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes among its files")


def test_a_file_takes_its_place_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "result.txt"
    with replacing(path) as temporary:
        temporary.write_text("half")
        assert not path.exists()
    assert [entry.name for entry in path.parent.iterdir()] == ["result.txt"]
    assert path.read_text() == "half"


def test_an_interruption_as_the_file_is_made_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    close = os.close

    def interrupted(handle: int) -> None:
        close(handle)
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "close", interrupted)
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "result.txt"):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="Windows has other permissions")
def test_a_file_has_the_rights_of_any_new_one_and_other_threads_files_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = os.umask(0o027)
    try:
        # While it is another one, so are the rights of what any other thread makes.
        monkeypatch.setattr(os, "umask", lambda _: pytest.fail("it is the whole process's"))
        with replacing(tmp_path / "result.txt") as temporary:
            assert temporary.stat().st_mode & 0o777 == 0o600
            temporary.write_text("new")
    finally:
        monkeypatch.undo()
        os.umask(before)
    assert (tmp_path / "result.txt").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "x"), RuntimeError("x"), KeyboardInterrupt()])
def test_whatever_ends_the_writing_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "result.txt"
    path.write_text("old")

    def fail(temporary: Path) -> None:
        temporary.write_text("new")
        raise error

    with pytest.raises((InputError, RuntimeError, KeyboardInterrupt)), replacing(path) as temporary:
        fail(temporary)
    assert [entry.name for entry in tmp_path.iterdir()] == ["result.txt"]
    assert path.read_text() == "old"


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EFBIG])
def test_a_disk_that_is_full_only_when_it_is_flushed_is_told(
    tmp_path: Path, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="the disk is full"), replacing(tmp_path / "result.txt") as temporary:
        temporary.write_text("new")
    assert not list(tmp_path.iterdir())


def test_a_network_share_that_cannot_be_flushed_is_no_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def not_offered(_: int) -> None:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    monkeypatch.setattr(os, "fsync", not_offered)
    with replacing(tmp_path / "result.txt") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "result.txt").read_text() == "new"


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENOTSUP])
def test_a_share_on_which_nobody_may_change_rights_is_written_to(
    tmp_path: Path, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(Path, "chmod", refused)
    with replacing(tmp_path / "result.txt") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "result.txt").read_text() == "new"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(("refusals", "written"), [(3, True), (1000, False)])
def test_windows_refuses_to_rename_what_a_scanner_has_open_for_a_moment(
    tmp_path: Path, refusals: int, written: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, left = Path.replace, [refusals]

    def refused_at_first(temporary: Path, target: Path) -> Path:
        if left[0]:
            left[0] -= 1
            raise PermissionError(errno.EACCES, "The process cannot access the file")
        return replace(temporary, target)

    monkeypatch.setattr(sys, "platform", "win32")
    # A busy computer may stand still for longer than a scanner takes.
    monkeypatch.setattr(atomic_file, "_SCANNERS_TAKE_S", 60.0 if written else 0.1)
    monkeypatch.setattr(Path, "replace", refused_at_first)
    path = tmp_path / "result.txt"
    path.write_text("old")
    outcome = nullcontext() if written else pytest.raises(InputError, match=r"cannot access the file\. Close other programs")
    with outcome, replacing(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == ("new" if written else "old")
    assert [entry.name for entry in tmp_path.iterdir()] == ["result.txt"]


def test_on_windows_a_name_that_would_be_that_of_a_part_of_a_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "CT 12:30.nii.gz"
    if os.name != "nt":
        check_writable(path)
    monkeypatch.setattr(sys, "platform", "win32")
    for attempt in (lambda: check_writable(path), lambda: replacing(path).__enter__()):
        with pytest.raises(InputError, match=r"a colon \(:\)"):
            attempt()


@pytest.mark.parametrize("folder", ["results ", "results...", "results . "])
def test_on_windows_a_folder_that_is_made_under_another_name_is_told_before_there_is_anything_to_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    path = tmp_path / folder / "CT.nii.gz"
    if os.name != "nt":
        check_writable(path)
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(InputError, match="no folder's name may end in a space or in dots"):
        check_writable(path)
    monkeypatch.setattr(atomic_file, "_make_and_remove_file", lambda folder: None)
    for fine in (tmp_path / ".." / "CT.nii.gz", Path("CT.nii.gz"), tmp_path / "2026.11.27" / "CT.nii.gz"):
        check_writable(fine)


def test_a_disk_that_is_not_there_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On Windows, not even the root of one is there, nor that of a share out of reach."""
    monkeypatch.setattr(atomic_file, "mode_of", lambda _: None)
    with pytest.raises(InputError, match=f"there is no disk {re.escape(tmp_path.anchor)}, or it is out of reach"):
        check_writable(tmp_path / "result.txt")


def test_on_windows_a_folder_that_may_not_be_written_to_is_told_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There, `tempfile` of older Pythons takes the refusal for a folder of the name that it tries, and tries 2**31 names."""
    asked = []

    def refused(path: Path, flags: int, mode: int) -> int:
        asked.append(flags)
        raise PermissionError(errno.EACCES, "Access is denied", str(path))

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os, "O_TEMPORARY", 0x40, raising=False)
    monkeypatch.setattr(os, "open", refused)
    monkeypatch.setattr("tempfile.TemporaryFile", lambda **_: pytest.fail("it would try for ever"))
    with pytest.raises(InputError, match=r"Access is denied\. Close other programs"):
        check_writable(tmp_path / "result.txt")
    assert [flags & 0x40 for flags in asked] == [0x40]


@pytest.mark.parametrize(
    ("name", "ending"),
    [
        ("Case 1.5 T.NII.GZ", ".nii.gz"),
        ("a.b.c.Seg.Nrrd", ".seg.nrrd"),
        ("report", ""),
        (f"{'x' * 40}.{'y' * 60}.nrrd", ".nrrd"),
    ],
)
def test_the_temporary_file_has_the_ending_in_lower_case_and_a_name_that_is_not_too_long(
    tmp_path: Path, name: str, ending: str
) -> None:
    with replacing(tmp_path / name) as temporary:
        assert temporary.name.endswith(ending)
        assert len(temporary.name) < 40
        temporary.write_text("new")
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


@PIPES
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_a_pipe_a_device_or_a_folder_is_no_place_for_a_file(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "result.txt"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/null")
    else:
        path.mkdir()
    before = path.lstat()
    for attempt in (lambda: check_writable(path), lambda: replacing(path).__enter__()):
        with pytest.raises(InputError, match=r"a pipe, a device or a socket|is a folder"):
            attempt()
    assert path.lstat() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 0)() == 0, reason="the administrator may write to everything")
def test_a_write_protected_file_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "result.txt"
    path.write_text("old")
    path.chmod(0o444)
    with pytest.raises(InputError, match="write-protected"):
        check_writable(path)


def test_a_name_that_no_file_can_have_is_refused_beforehand(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        check_writable(tmp_path / ("a" * 300))


@pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")
def test_a_name_below_a_loop_of_links_is_refused_beforehand(tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(InputError):
        check_writable(loop / "result.txt")
