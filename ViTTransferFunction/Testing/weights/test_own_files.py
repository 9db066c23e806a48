"""Weights from the user's own file: `--weights`, `VITTF_WEIGHTS`, and knowing a file's model."""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import os
import re
import shutil
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.weights import download
from ViTTransferFunction.Logic.weights.download import sha256_of
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Logic.weights.sources import (
    WeightsUnavailable,
    fetch_weights,
    find_weights,
    identify_model,
    offered_models,
)
from ViTTransferFunction.Logic.weights.store import weights_folder

WEIGHTS = b"weights"
SHA256 = hashlib.sha256(WEIGHTS).hexdigest()
NAME = "dino_vits8"


@pytest.fixture
def hashed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the hash of `WEIGHTS` be published."""
    monkeypatch.setitem(PRETRAINED_MODELS, NAME, dataclasses.replace(PRETRAINED_MODELS[NAME], sha256=SHA256))


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own.pth"
    path.write_bytes(WEIGHTS)
    return path


@pytest.fixture
def cached(own: Path) -> Path:
    """The same file in the cache."""
    path = weights_folder() / "dino_vits8.pt"
    path.parent.mkdir(parents=True)
    return Path(shutil.copy(own, path))


def test_one_of_unknown_hash_is_used_and_its_hash_shown(own: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        weights = find_weights(NAME, own)

    assert (weights.path, weights.sha256, weights.origin) == (own, SHA256, "given path")
    assert SHA256 in caplog.text


@pytest.mark.usefixtures("hashed")
def test_one_of_published_hash_is_used_silently(own: Path, caplog: pytest.LogCaptureFixture) -> None:
    find_weights(NAME, own)

    assert not caplog.records


def test_one_whose_hash_begins_as_the_published_one_is_known_and_used_silently(
    own: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    name = "dinov3_vits16"
    monkeypatch.setitem(PRETRAINED_MODELS, name, dataclasses.replace(PRETRAINED_MODELS[name], sha256_start=SHA256[:8]))

    assert identify_model(own) == name
    assert find_weights(name, own).path == own
    assert not caplog.records


@pytest.mark.usefixtures("hashed")
def test_one_of_another_model_is_refused_by_that_models_name(own: Path) -> None:
    with pytest.raises(InputError, match="holds the weights of 'dino_vits8', expected those of 'dinov2_vits14'"):
        find_weights("dinov2_vits14", own)


def test_one_that_changes_again_within_the_same_moment_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some file systems tell times by two seconds."""
    path = tmp_path / "own.pth"
    path.write_bytes(b"one")
    status = path.stat()
    monkeypatch.setattr(os, "fstat", lambda _: status)
    monkeypatch.setattr(download, "_RECENT_S", 3600.0)  # However busy this computer is.
    for content in (b"one", b"two"):
        path.write_bytes(content)
        assert sha256_of(path) == hashlib.sha256(content).hexdigest()


def test_a_missing_one_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no weights file .*absent\.pth \(given path\)"):
        find_weights(NAME, tmp_path / "absent.pth")


def test_a_folder_is_searched_for_the_model(own: Path) -> None:
    own.rename(own.with_name("dino_vits8.pth"))

    assert find_weights(NAME, own.parent).path == own.with_name("dino_vits8.pth")


def test_a_folder_without_the_model_is_refused_with_the_file_name_expected_there(own: Path) -> None:
    with pytest.raises(InputError, match=r"dino_deitsmall8_pretrain\.pth or dino_vits8\.pt or dino_vits8\.pth"):
        find_weights(NAME, own.parent)


def test_the_variable_names_a_file(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(own))

    assert find_weights(NAME).origin == "VITTF_WEIGHTS"


def test_the_given_path_comes_before_the_variable(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(own.with_name("absent.pth")))

    assert find_weights(NAME, own).origin == "given path"


def test_the_variables_folder_without_the_model_leaves_it_to_the_cache(
    cached: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(tmp_path))

    assert find_weights(NAME).path == cached


def test_a_folder_that_has_another_model_is_said_to(own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(own, tmp_path / "dinov2_vits14_focus.pt")
    there = f"those of 'dinov2_vits14_focus' in {tmp_path}: to use them, name that file itself"
    with pytest.raises(InputError, match=re.escape(there)):
        find_weights(NAME, tmp_path)
    monkeypatch.setenv("VITTF_WEIGHTS", str(tmp_path))
    with pytest.raises(WeightsUnavailable, match=re.escape(there)):
        find_weights(NAME, allow_download=False)


def test_filling_the_cache_does_not_ask_the_variable(own: Path, cached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(own))

    assert fetch_weights(NAME).path == cached


@pytest.mark.usefixtures("hashed")
@pytest.mark.parametrize("file_name", ["own.pth", "dinov2_vits14_reg.pt"])
def test_its_model_is_known_by_its_hash_whatever_it_is_called(own: Path, file_name: str) -> None:
    assert identify_model(own.rename(own.with_name(file_name))) == NAME


@pytest.mark.parametrize(
    ("file_name", "model"),
    [
        ("dinov2_vits14_reg.pt", "dinov2_vits14_reg"),
        ("dinov2_vits14_reg4_pretrain.pth", "dinov2_vits14_reg"),
        ("dinov3_vits16plus_pretrain_lvd1689m-4057cbaa.pth", "dinov3_vits16plus"),
    ],
)
def test_its_model_is_known_by_its_name(own: Path, file_name: str, model: str) -> None:
    own = own.rename(own.with_name(file_name))

    assert identify_model(own) == model


def test_a_folder_with_the_file_of_one_model_alone_is_taken_for_that_model(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The panel need not offer it: of such as nobody publishes, it lists those that were there when it was opened."""
    folder = tmp_path / "share"
    folder.mkdir()
    shutil.copy(own, folder / "dinov2_vits14_focus.pt")
    assert identify_model(folder) == "dinov2_vits14_focus"
    shutil.copy(own, folder / "dinov2_vits14.pt")
    assert identify_model(folder) is None
    (folder / "dinov2_vits14.pt").unlink()
    monkeypatch.setenv("VITTF_WEIGHTS", str(folder))
    assert identify_model() is None


def test_a_model_that_nobody_publishes_is_offered_where_the_variable_names_its_file_and_not_one_beside_it(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    focus = tmp_path / "dinov2_vits14_focus.pt"
    shutil.copy(own, focus)
    for named, is_offered in ((tmp_path, True), (focus, True), (own, False)):
        monkeypatch.setenv("VITTF_WEIGHTS", str(named))
        assert ("dinov2_vits14_focus" in offered_models()) is is_offered


def test_its_model_is_unknown_where_neither_hash_nor_name_is_known(own: Path) -> None:
    assert identify_model(own) is None
    assert identify_model(own.parent) is None


def test_the_model_of_the_variables_file_is_known_too(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert identify_model() is None
    monkeypatch.setenv("VITTF_WEIGHTS", str(own.rename(own.with_name("dino_vitb8.pt"))))
    assert identify_model() == "dino_vitb8"
