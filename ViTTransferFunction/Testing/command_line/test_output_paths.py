"""What `vittf` would write over what it reads, or over what else it writes, is refused before anything is computed."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.CommandLine.output_paths import check_apart
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.file_names import file_stem

VOXELS = np.random.default_rng(0).integers(1, 1000, (8, 9, 10)).astype(np.int16)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with everything that is read; the weights are none, so that nothing can be computed."""
    monkeypatch.chdir(tmp_path)
    image = sitk.GetImageFromArray(VOXELS)
    for name in ("scan.nrrd", "pair.mhd", "scan.nii.gz"):
        sitk.WriteImage(image, name)
    sitk.WriteImage(sitk.Cast(image > 500, sitk.sitkUInt8), "labels.nrrd")
    points_file("clicks.json", "left")
    Path("l.mrk.json").write_text(json.dumps({"markups": [{"controlPoints": [{"position": [5, 4, 4]}]}]}))
    Path("weights.pt").write_bytes(b"weights")
    if os.name != "nt":
        Path("link.nrrd").symlink_to("scan.nrrd")
    os.link("scan.nrrd", "hard.nrrd")
    return tmp_path


def points_file(name: str, *classes: str) -> None:
    content = [{"name": entry, "positive": [[5, 4, 4]]} for entry in classes]
    Path(name).write_text(json.dumps({"coordinate_system": "IJK", "classes": content}))


def refusal(arguments: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Run `vittf`, which must fail in one sentence and change nothing; returns that sentence."""

    def content() -> dict[Path, bytes]:
        return {path: path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}

    before = content()
    assert main(arguments) == 2
    assert content() == before
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "is not known as that of" not in line)
    assert line.startswith("error: ")
    return line


LINKS = pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")
OPTIONS = ["--annotations", "clicks.json", "--weights", "weights.pt"]
SEGMENT = ["segment", "scan.nrrd", *OPTIONS]
MARKED = ["segment", "scan.nrrd", "--weights", "weights.pt", "--positive", "l=l.mrk.json", "--negative", "l=n.json"]


@pytest.mark.parametrize(
    "arguments",
    [
        [*SEGMENT, "-o", "scan.nrrd"],
        [*SEGMENT, "-o", "./scan.nrrd"],
        pytest.param([*SEGMENT, "-o", "link.nrrd"], marks=LINKS),
        [*SEGMENT, "-o", "hard.nrrd"],
        [*SEGMENT, "-o", "SCAN.nrrd"],
        pytest.param(["segment", "link.nrrd", *OPTIONS, "-o", "scan.nrrd"], marks=LINKS),
        ["segment", "scan.nii.gz", *OPTIONS, "-o", "scan.nii"],
        ["segment", "pair.mhd", *OPTIONS, "-o", "out.nrrd", "--report", "pair.raw"],
        ["segment", "left.nii.gz", *OPTIONS, "-o", "out.nrrd", "--similarity-dir", "."],
        [*SEGMENT, "-o", "out.nrrd", "--report", "clicks.json"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "scan.nrrd"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "weights.pt"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "out.nrrd"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "Out.nrrd"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "out.nrrd/report.json"],
        [*SEGMENT, "-o", "out.nrrd", "--similarity-dir", "out.nrrd"],
        [*SEGMENT, "-o", "left.nii.gz", "--similarity-dir", "."],
        [*SEGMENT, "-o", "out.nrrd", "--similarity-dir", "maps", "--report", "MAPS/left.nii.gz"],
        [*MARKED, "-o", "out.nrrd", "--report", "l.mrk.json"],
        [*MARKED, "-o", "out.nrrd", "--report", "N.json"],
        ["render", "scan.nrrd", "labels.nrrd", "-o", "p.png", "--annotations", "p_3d.png"],
        ["render", "scan.nrrd", "labels.nrrd", "-o", "p.png", "--annotations", "P.PNG"],
    ],
    ids=" ".join,
)
def test_an_output_that_is_an_input_or_another_output_is_refused(
    folder: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "left.nii.gz").write_bytes((folder / "scan.nii.gz").read_bytes())
    assert "would be written over" in refusal(arguments, folder, capsys)


def test_files_of_a_disk_that_numbers_none_are_told_apart_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On Windows, of network shares."""
    for name in ("scan.nrrd", "out.nrrd"):
        (tmp_path / name).touch()
    monkeypatch.setattr(Path, "stat", lambda _: SimpleNamespace(st_dev=7, st_ino=0))
    check_apart({"the segmentation": tmp_path / "out.nrrd"}, {"the volume": [tmp_path / "scan.nrrd"]})
    with pytest.raises(InputError, match="would be written over"):
        check_apart({"the segmentation": tmp_path / "Scan.nrrd"}, {"the volume": [tmp_path / "scan.nrrd"]})


def test_two_classes_whose_maps_would_be_one_file_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for names in (("a/b", "a:b"), ("Liver", "liver"), (" x", "x")):
        points_file("clicks.json", *names)
        message = refusal([*SEGMENT, "-o", "out.nrrd", "--similarity-dir", "maps"], folder, capsys)
        assert f"class '{names[0]}'" in message
        assert f"class '{names[1]}'" in message


@pytest.mark.parametrize(
    "arguments",
    [
        [*SEGMENT, "-o", "folder.nrrd"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "folder.nrrd"],
        [*SEGMENT, "-o", "out.nrrd", "--similarity-dir", "scan.nii.gz"],
        ["render", "scan.nrrd", "labels.nrrd", "-o", "folder.png"],
        ["render", "scan.nrrd", "labels.nrrd", "-o", "picture.png"],
    ],
    ids=" ".join,
)
def test_a_folder_where_a_file_is_to_be_and_a_file_where_a_folder_is_to_be_are_refused(
    folder: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("folder.nrrd", "folder.png", "picture_3d.png"):
        (folder / name).mkdir()
    assert "Cannot write" in refusal(arguments, folder, capsys)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes among its files")
@pytest.mark.parametrize(
    "arguments",
    [
        ["segment", "pipe", *OPTIONS, "-o", "out.nrrd"],
        ["segment", "scan.nrrd", "--annotations", "pipe", "-o", "out.nrrd"],
        ["segment", "scan.nrrd", "--positive", "left=pipe", "-o", "out.nrrd"],
        ["segment", "scan.nrrd", "--annotations", "clicks.json", "--weights", "pipe", "-o", "out.nrrd"],
        [*SEGMENT, "-o", "pipe.nrrd"],
        [*SEGMENT, "-o", "out.nrrd", "--report", "/dev/null"],
        ["render", "pipe.nrrd", "labels.nrrd", "-o", "p.png"],
        ["render", "scan.nrrd", "pipe.nrrd", "-o", "p.png"],
        ["render", "scan.nrrd", "labels.nrrd", "-o", "p.png", "--annotations", "pipe"],
    ],
    ids=" ".join,
)
def test_a_pipe_or_a_device_is_refused_and_not_waited_for(
    folder: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("pipe", "pipe.nrrd"):
        os.mkfifo(folder / name)
    assert "a pipe, a device or a socket" in refusal(arguments, folder, capsys)


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (("5000", "6000"), "shows nothing of 'scan'"),
        (("-6000", "-5000"), "shows nothing of 'scan'"),
        (("0", "1e39"), "the lower first"),
        (("nan", "5"), "the lower first"),
    ],
)
def test_a_window_that_shows_nothing_is_refused(
    folder: Path, bounds: tuple[str, str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in refusal([*SEGMENT, "-o", "out.nrrd", "--window", *bounds], folder, capsys)


@pytest.mark.parametrize(
    ("name", "stem"),
    [("a/b", "a_b"), ("Leber, groß", "Leber_ groß"), ("..", "__"), (" ", "_"), ("nul", "_nul"), ("COM1", "_COM1")]
    # Vowels and accents that are characters of their own, in Hindi and Thai, and in names that a Mac decomposed.
    + [(name, name) for name in ("यकृत", "ตับ", "Dru\u0308se")],
)
def test_the_name_of_a_class_becomes_a_file_name_that_every_platform_takes(name: str, stem: str) -> None:
    assert file_stem(name) == stem


@pytest.mark.parametrize("letter", ["n", "肝", "ü"])
def test_the_name_of_a_class_that_is_too_long_for_a_file_is_shortened(tmp_path: Path, letter: str) -> None:
    stem = file_stem(300 * letter)
    assert set(stem) == {letter}
    (tmp_path / f"{stem}.nii.gz").touch()
