"""`vittf features`: features are in the cache afterwards, or it says that they are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
import torch

from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict


@pytest.fixture
def arguments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The command for a small scan, with a tiny network."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    torch.save(random_state_dict(TINY_MODEL), tmp_path / "tiny.pth")
    voxels = np.random.default_rng(0).normal(0.0, 10.0, (12, 16, 20)).astype(np.float32)
    sitk.WriteImage(sitk.GetImageFromArray(voxels), str(tmp_path / "scan.nrrd"))
    options = ["--model", "tiny", "--weights", str(tmp_path / "tiny.pth"), "--grid", "5", "--device", "cpu"]
    return ["features", str(tmp_path / "scan.nrrd"), *options]


def test_features_are_in_the_cache_afterwards(arguments: list[str]) -> None:
    assert main(arguments) == 0
    assert len(FeatureCache().entries()) == 1


def test_where_the_cache_cannot_keep_them_the_command_has_failed(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a file").write_text("")
    monkeypatch.setenv("VITTF_CACHE", str(tmp_path / "a file"))
    assert main(arguments) == 2
    assert f"{tmp_path / 'a file' / 'features'} cannot keep them" in capsys.readouterr().err
