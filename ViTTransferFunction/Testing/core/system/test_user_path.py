"""Paths as users write them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.system.cache_folder import cache_folder
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.user_path import user_path
from ViTTransferFunction.Logic.weights.sources import find_weights, offered_models

NO_SUCH_HOME = pytest.mark.skipif(os.name == "nt", reason="Windows' Python takes each user's home to lie beside one's own")
LINKS = pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")
NO_PATHS = [
    pytest.param("~nosuchuser/weights.pt", marks=NO_SUCH_HOME),
    "x" * 300,
    "a/" * 3000,
    pytest.param("loop/a", marks=LINKS),
]
IMPOSSIBLE = "cannot be a weights file|Cannot open|is too long a path"


@pytest.fixture(autouse=True)
def a_loop_of_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.name != "nt":
        (tmp_path / "loop").symlink_to("loop")
    monkeypatch.chdir(tmp_path)


def test_the_home_folder_is_spelled_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert user_path("~/a.pt", "a weights file") == tmp_path / "a.pt"


@pytest.mark.parametrize("text", ['"a b/c.nii"', "'a b/c.nii'", "a b/c.nii"])
def test_quotes_around_a_path_are_left_out(text: str) -> None:
    assert user_path(text, "a volume") == Path("a b/c.nii")


@pytest.mark.parametrize("text", [*NO_PATHS, "a\0b"])
def test_what_can_be_no_path_is_refused_in_a_short_sentence(text: str) -> None:
    with pytest.raises(InputError, match=rf"{IMPOSSIBLE}|is no path") as refused:
        user_path(text, "a weights file")
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize("text", NO_PATHS)
def test_weights_at_no_possible_path_are_refused_when_they_are_needed(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=IMPOSSIBLE):
        find_weights("dinov2_vits14", text)
    monkeypatch.setenv("VITTF_WEIGHTS", text)
    with pytest.raises(InputError, match=rf"VITTF_WEIGHTS|{IMPOSSIBLE}"):
        find_weights("dinov2_vits14")
    assert "dinov2_vits14" in offered_models()


@NO_SUCH_HOME
def test_a_cache_at_no_possible_path_is_refused_and_models_are_offered_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VITTF_CACHE", "~nosuchuser")
    with pytest.raises(InputError, match="VITTF_CACHE"):
        cache_folder()
    assert "dinov2_vits14" in offered_models()


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps the folder that a program is in")
def test_a_relative_cache_in_a_folder_that_was_deleted_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    monkeypatch.setenv("VITTF_CACHE", "cache")
    with pytest.raises(InputError, match="no folder for the cache"):
        cache_folder()
