"""Nothing removes or replaces what this program itself has open, which Windows would refuse; see `support/windows_files.py`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
import torch

from ViTTransferFunction.CommandLine.cohort.folder_lock import LOCK, only_cohort_in
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.files.film import FilmPlan, write_film
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Logic.weights.store import file_names, remember, remove_weights, weights_folder
from ViTTransferFunction.Testing.features.test_cache import features_named
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict
from ViTTransferFunction.Testing.support.windows_files import HELD, NOT_NEEDED, as_on_windows
from ViTTransferFunction.WebApp.packing import gzip_nrrd, zip_folder

pytestmark = pytest.mark.skipif(not NOT_NEEDED and not HELD.is_dir(), reason="only Linux tells what is open")


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What Windows would have refused until now."""
    return as_on_windows(monkeypatch)


@pytest.fixture
def scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scan with a point beside it, in a working folder with weights."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(PRETRAINED_MODELS, "tiny", TINY_MODEL)
    torch.save(random_state_dict(TINY_MODEL), "tiny.pth")
    voxels = np.random.default_rng(0).integers(0, 100, (6, 7, 8)).astype(np.int16)
    for name in ("scan.nii.gz", "scan.nii", "scan.nrrd"):
        sitk.WriteImage(sitk.GetImageFromArray(voxels), name)
    points = {"coordinate_system": "IJK", "classes": [{"name": "liver", "positive": [[4, 3, 3]]}]}
    Path("points.json").write_text(json.dumps(points))
    return tmp_path / "scan.nii.gz"


@pytest.mark.parametrize("hold", [lambda path: path.open("rb"), lambda path: np.memmap(path, np.uint8, "r")])
def test_what_is_open_or_mapped_is_refused(hold: Callable[[Path], object], tmp_path: Path, refused: list[str]) -> None:
    for name in ("held", "other"):
        (tmp_path / name).write_bytes(b"voxels")
    held = hold(tmp_path / "held")
    attempts = (
        lambda: (tmp_path / "held").unlink(),
        lambda: (tmp_path / "held").rename(tmp_path / "new"),
        lambda: (tmp_path / "other").replace(tmp_path / "held"),
    )
    for attempt in attempts:
        with pytest.raises(PermissionError):
            attempt()
    assert NOT_NEEDED or len(refused) == 3
    del held
    (tmp_path / "other").replace(tmp_path / "held")


@pytest.mark.parametrize("output", ["out.seg.nrrd", "out.nii.gz", "out.mha"])
def test_a_scan_is_segmented_twice_and_its_features_are_removed(scan: Path, output: str, refused: list[str]) -> None:
    # Beside scan.nii, scan.nii.gz is read by way of another folder.
    arguments = ["segment", str(scan), "--annotations", "points.json", "-o", output, "--report", "report.json"]
    arguments += ["--similarity-dir", "maps", "--model", "tiny", "--weights", "tiny.pth", "--grid", "8", "--device", "cpu"]
    assert main(arguments) == main(arguments) == 0
    assert FeatureCache().entries()
    assert main(["cache", "clear"]) == 0
    assert FeatureCache().entries() == []
    assert refused == []


def test_features_that_another_program_has_open_stay_and_that_is_said(
    refused: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    cache = FeatureCache()
    for name in "ab":
        cache.put(features_named(name))
    (held, *_) = cache.entries()
    with (cache.folder / f"{held.key}.npz").open("rb"):
        assert main(["cache", "clear"]) == 2
        assert "Close other programs that have them open" in capsys.readouterr().err
        assert [entry.key for entry in cache.entries()] == [held.key]
    assert main(["cache", "clear"]) == 0
    assert cache.entries() == []


def test_damaged_features_are_replaced(scan: Path, refused: list[str]) -> None:
    arguments = ["features", str(scan), "--model", "tiny", "--weights", "tiny.pth", "--grid", "8", "--device", "cpu"]
    assert main(arguments) == 0
    (features,) = FeatureCache().folder.glob("*.npz")
    for damage in (b"", features.read_bytes()[:-100]):
        features.write_bytes(damage)
        assert main(arguments) == 0
        assert len(features.read_bytes()) > 1000
    assert refused == []


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_a_film_is_written_over_another(tmp_path: Path, name: str, refused: list[str]) -> None:
    pytest.importorskip({".gif": "PIL", ".mp4": "imageio_ffmpeg"}[Path(name).suffix])
    (tmp_path / name).write_bytes(b"another film")
    frame = np.zeros((48, 64, 3), np.uint8)
    write_film(FilmPlan(tmp_path / name, frames=3, seconds=1.0), lambda number: frame + np.uint8(40 * number))
    assert len((tmp_path / name).read_bytes()) > 100
    assert refused == []


def test_weights_are_remembered_listed_and_removed(scan: Path, refused: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    model = PRETRAINED_MODELS["dino_vits8"]
    path = weights_folder() / file_names(model)[0]
    path.parent.mkdir(parents=True)
    path.write_bytes(Path("tiny.pth").read_bytes())
    remember(model, path, "0" * 64)
    assert main(["weights", "list"]) == 0
    assert len(remove_weights(model.name)) == 2
    assert refused == []


def test_what_the_app_saves_is_packed_and_removed(tmp_path: Path, refused: list[str]) -> None:
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "scan.nrrd").write_bytes(b"NRRD0004\ntype: uint8\nencoding: raw\n\n\1\2\3")
    gzip_nrrd(tmp_path / "session" / "scan.nrrd", tmp_path / "scan.seg.nrrd")
    zip_folder(tmp_path / "session", tmp_path / "session.mrb")
    assert not (tmp_path / "session" / "scan.nrrd").exists()
    assert refused == []


def test_the_lock_of_a_cohorts_folder_is_removed_once_it_is_closed(
    tmp_path: Path, refused: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[int] = []

    def locking(descriptor: int, mode: str, count: int) -> None:
        if taken:
            raise PermissionError(13, "Permission denied")
        taken.append(descriptor)

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK="at once"))
    with only_cohort_in(tmp_path):
        with pytest.raises(InputError, match="Another cohort"), only_cohort_in(tmp_path):
            pass
        assert (tmp_path / LOCK).exists()
    assert not (tmp_path / LOCK).exists()
    # Before it is closed it cannot be, which is no matter.
    assert NOT_NEEDED or len(refused) == 1
