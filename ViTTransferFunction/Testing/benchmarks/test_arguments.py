"""Which weights a benchmark measures with."""

from __future__ import annotations

from pathlib import Path

import pytest

from Benchmarks.shared.arguments import network_parser, weights_of
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A weights file whose name says nothing."""
    path = tmp_path / "weights.pth"
    path.write_bytes(b"weights")
    return path


@pytest.mark.parametrize("name", PRETRAINED_MODELS)
def test_any_model_is_measured_with_a_file_that_is_named_for_it(file: Path, name: str) -> None:
    options = network_parser(None).parse_args(["--volumes", ".", "--weights", str(file), "--model", name])

    weights = weights_of(options)

    assert (weights.path, weights.model) == (file, PRETRAINED_MODELS[name])


@pytest.mark.parametrize("name", PRETRAINED_MODELS)
def test_without_a_model_the_files_name_says_it(file: Path, name: str) -> None:
    file = file.rename(file.with_name(PRETRAINED_MODELS[name].file_name))
    options = network_parser(None).parse_args(["--volumes", ".", "--weights", str(file)])

    assert weights_of(options).model.name == name


def test_figures_of_one_model_are_not_kept_as_those_of_another(file: Path, tmp_path: Path) -> None:
    folders = set()
    for name in ("dino_vits8", "dinov3_vits16"):
        command = ["--volumes", ".", "--weights", str(file), "--model", name, "--keep", str(tmp_path)]
        options = network_parser(None).parse_args(command)
        weights_of(options)
        folders.add(options.keep)

    assert len(folders) == 2
    assert {folder.parent for folder in folders} == {tmp_path}
