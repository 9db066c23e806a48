"""`vittf weights list|get|remove`."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import io
import types
from collections.abc import Callable
from pathlib import Path

import pytest

from ViTTransferFunction.CommandLine import weights_command
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.weights import sources
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Logic.weights.store import weights_folder

WEIGHTS = b"weights"
SHA256 = hashlib.sha256(WEIGHTS).hexdigest()
NAME = "dino_vits8"


@pytest.fixture(autouse=True)
def cached(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cached file of one model."""
    monkeypatch.setitem(PRETRAINED_MODELS, NAME, dataclasses.replace(PRETRAINED_MODELS[NAME], sha256=SHA256))
    path = weights_folder() / f"{NAME}.pth"
    path.parent.mkdir()
    path.write_bytes(WEIGHTS)
    return path


def vittf(*words: str) -> int:
    parser = argparse.ArgumentParser("vittf")
    weights_command.add_arguments(parser.add_subparsers())
    args = parser.parse_args(words)
    return args.run(args)


def test_the_list_says_terms_size_hash_and_place_of_every_model(cached: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vittf("weights", "list") == 0

    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line}
    assert lines.keys() > PRETRAINED_MODELS.keys()
    for part in ("Apache-2.0", "87 MB", SHA256[:12], str(cached)):
        assert part in lines[NAME]
    assert lines["dinov2_vitb14"].endswith("not downloaded")
    assert "DINOv3 License" in lines["dinov3_vits16"]
    assert lines["dinov3_vits16"].endswith("ask for it at https://ai.meta.com/resources/models-and-libraries/dinov3-downloads/")


def test_the_list_points_out_a_damaged_file(cached: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cached.write_bytes(b"damaged")

    assert vittf("weights", "list") == 0

    assert f"DAMAGED, remove and get again: {cached}" in capsys.readouterr().out


def test_getting_says_terms_place_and_hash(cached: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vittf("weights", "get", NAME) == 0

    out = capsys.readouterr().out
    for part in ("Apache-2.0", "Caron et al.", f"{cached} (cache)", SHA256):
        assert part in out


def test_removing_names_what_was_removed(cached: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vittf("weights", "remove", NAME) == 0

    assert capsys.readouterr().out == f"removed {cached}\n"
    assert not cached.exists()


@pytest.mark.parametrize("action", ["get", "remove"])
def test_an_unknown_model_is_left_to_the_one_place_that_shows_errors(action: str) -> None:
    with pytest.raises(InputError, match="Unknown model 'resnet50'"):
        vittf("weights", action, "resnet50")


class TestAModelWhoseHashNobodyPublishes:
    @pytest.fixture(autouse=True)
    def delivered(self, cached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Its file is not here, and what is downloaded has the hash `SHA256`."""

        def download(url: str, target: Path, *, accept: Callable[[str], bool], **_: object) -> str:
            if not accept(SHA256):
                raise InputError("not accepted")
            target.write_bytes(WEIGHTS)
            return SHA256

        cached.unlink()
        monkeypatch.setitem(PRETRAINED_MODELS, NAME, dataclasses.replace(PRETRAINED_MODELS[NAME], sha256=None))
        monkeypatch.setattr(sources, "download", download)

    def test_where_nobody_can_be_asked_the_command_that_trusts_it_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sys.stdin", io.StringIO())
        with pytest.raises(InputError, match=f"vittf weights get {NAME} --sha256 {SHA256}"):
            vittf("weights", "get", NAME)

    def test_the_hash_that_was_named_is_trusted_and_no_other(self) -> None:
        with pytest.raises(InputError, match="not accepted"):
            vittf("weights", "get", NAME, "--sha256", "0" * 64)
        assert vittf("weights", "get", NAME, "--sha256", SHA256.upper()) == 0

    @pytest.mark.parametrize(("answer", "trusted"), [("y", True), ("Yes", True), ("", False), ("n", False)])
    def test_the_user_sees_the_hash_and_is_asked(self, answer: str, trusted: bool, monkeypatch: pytest.MonkeyPatch) -> None:
        questions: list[str] = []

        def answers(question: str) -> str:
            questions.append(question)
            return answer

        monkeypatch.setattr("sys.stdin", types.SimpleNamespace(isatty=lambda: True))
        monkeypatch.setattr("builtins.input", answers)
        if trusted:
            assert vittf("weights", "get", NAME) == 0
        else:
            with pytest.raises(InputError, match="not accepted"):
                vittf("weights", "get", NAME)
        assert SHA256 in questions[0]


def test_the_list_has_the_files_that_the_environment_supplies_in_the_place_of_cached_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in (tmp_path / f"{NAME}.pth", tmp_path / "dinov2_vitb14.pt"):
        path.write_bytes(b"of the department")
    monkeypatch.setenv("VITTF_WEIGHTS", str(tmp_path))
    assert vittf("weights", "list") == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line}
    assert lines[NAME].endswith(
        f"{hashlib.sha256(b'of the department').hexdigest()[:12]}  {tmp_path / NAME}.pth (VITTF_WEIGHTS)"
    )
    assert lines["dinov2_vitb14"].endswith(f"{tmp_path / 'dinov2_vitb14.pt'} (VITTF_WEIGHTS)")
    assert lines["dinov2_vits14"].endswith("not downloaded")
    assert lines["VITTF_WEIGHTS,"].endswith(str(tmp_path))


def test_the_list_tells_the_model_of_a_file_that_the_environment_names(
    cached: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = cached.rename(tmp_path / "mine.pth")
    monkeypatch.setenv("VITTF_WEIGHTS", str(mine))
    assert vittf("weights", "list") == 0
    assert f"{SHA256[:12]}  {mine} (VITTF_WEIGHTS)" in capsys.readouterr().out


def test_the_list_is_there_where_the_environment_names_nothing_that_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(tmp_path / "gone"))
    assert vittf("weights", "list") == 0
    out = capsys.readouterr().out
    assert "not downloaded" in out
    assert str(tmp_path / "gone") in out.splitlines()[-1]
