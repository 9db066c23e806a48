"""`--series`: which of a DICOM folder's series the commands take."""

from __future__ import annotations

from pathlib import Path

import pytest
import SimpleITK as sitk  # noqa: N813
import torch

from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.files.test_several_series import write_two
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict

COMMANDS = (
    ["segment", "disk", "--annotations", "points.json", "-o", "out.seg.nrrd"],
    ["features", "disk"],
    ["render", "disk", "labels.nrrd", "-o", "picture.png"],
)


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with two series, beside what the commands need, in the current folder."""
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    torch.save(random_state_dict(TINY_MODEL), tmp_path / "tiny.pth")
    write_two(tmp_path / "disk")
    sitk.WriteImage(sitk.Image([4, 4, 4], sitk.sitkUInt8), str(tmp_path / "labels.nrrd"))
    (tmp_path / "points.json").write_text("{}")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "disk"


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
@pytest.mark.parametrize(
    ("series", "message"),
    [
        ([], "disk holds 2 DICOM volumes to choose from: 2: T1 axial (MR, 7×6×3); 12: T2"),
        (["--series", "9"], "No DICOM series in disk is '9'"),
    ],
)
def test_where_nobody_can_tell_which_series_is_meant_the_commands_list_them(
    disk: Path, capsys: pytest.CaptureFixture[str], command: list[str], series: list[str], message: str
) -> None:
    assert main([*command, *series]) == 2
    assert message in capsys.readouterr().err


def test_features_are_computed_of_the_series_that_was_named(disk: Path) -> None:
    options = ["--model", "tiny", "--weights", "tiny.pth", "--grid", "5", "--device", "cpu"]
    for series in ("T1", "12", "T2"):
        assert main(["features", "disk", "--series", series, *options]) == 0
    assert len(FeatureCache().entries()) == 2
