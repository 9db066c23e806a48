"""Names of files: with an ending, and as they were."""

from __future__ import annotations

from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.file_names import kept_name, with_ending

FILM = (".gif", ".mp4")


@pytest.mark.parametrize(
    "name", ["liver", "liver 2.5", "0.3x0.3x10 mm", "Dr. Smith", "No. 3", "scan.2024.11.23", "liver.", "肝.臓"]
)
def test_a_name_without_an_ending_gets_one(tmp_path: Path, name: str) -> None:
    assert with_ending(tmp_path / name, FILM) == tmp_path / f"{name}.gif"


@pytest.mark.parametrize("name", ["liver.gif", "liver.MP4", "liver 2.5.mp4"])
def test_an_ending_of_the_kind_stays(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    assert with_ending(tmp_path / name, FILM) == tmp_path / name


@pytest.mark.parametrize("name", ["liver.avi", "liver.webm", "liver 2.5.PNG"])
def test_the_ending_of_another_kind_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"end in \.gif or \.mp4"):
        with_ending(tmp_path / name, FILM)


def test_a_file_that_was_not_chosen_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "liver 2.5.gif").touch()
    with pytest.raises(InputError, match="is there already"):
        with_ending(tmp_path / "liver 2.5", FILM)


@pytest.mark.parametrize("name", ["scan", "a.b", "CT 3.2 Müller", "肝臓", "x" * 200])
def test_a_name_that_a_file_has_is_kept(name: str) -> None:
    assert kept_name(name) == name


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("a/b\\c:d", "a_b_c_d"),
        ("", "_"),
        ("..", "_.."),
        ("NUL", "_NUL"),
        ("COM¹.2", "_COM¹.2"),
        ("gnp\u202e.exe", "gnp_.exe"),
        ("\udc80\n", "__"),
        ("ü" * 200, "ü" * 100),
    ],
)
def test_what_some_system_takes_in_no_file_s_name_is_replaced(name: str, kept: str) -> None:
    assert kept_name(name) == kept
