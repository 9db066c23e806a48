"""DICOM series whose slices are no stack on a grid: refused, or read with a warning."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.files.volume_files import files_of, read_volume
from ViTTransferFunction.Testing.attack.scans import Scan, write_dicom

SAGITTAL = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of a right-handed stack, in columns."""


def stack(slices: int = 8, direction: np.ndarray | None = None, spacing: tuple[float, ...] = (1.0, 1.0, 3.0)) -> Scan:
    array = np.random.default_rng(0).integers(0, 100, (slices, 6, 7)).astype(np.int16)
    return Scan(array, np.array(spacing), np.eye(3) if direction is None else direction, np.zeros(3), ([0] * 3, [0] * 3))


def warnings_of(folder: Path) -> list[str]:
    warnings: list[str] = []
    read_volume(folder, warnings.append)
    return warnings


def write_moved(folder: Path, scan: Scan, step: tuple[float, float, float]) -> None:
    """Write a scan's slices each further away by `step` millimetres than they should be."""
    for k in range(len(scan.array)):
        origin = scan.direction @ [0.0, 0.0, k * scan.spacing[2]] + np.array(step) * k
        write_dicom(folder, Scan(scan.array[k : k + 1], scan.spacing, scan.direction, origin, scan.inside), first=k)


@pytest.mark.parametrize("direction", [np.eye(3), SAGITTAL])
def test_of_a_regular_stack_there_is_nothing_to_say(tmp_path: Path, direction: np.ndarray) -> None:
    write_dicom(tmp_path, stack(direction=direction))
    assert warnings_of(tmp_path) == []


@pytest.mark.parametrize("name", ["liver.seg.nrrd", "Liver.NII.GZ", "view.png", "turn.gif", "turn.mp4", "camera.json"])
def test_a_result_beside_the_slices_is_none_of_them_and_may_be_written_again(tmp_path: Path, name: str) -> None:
    paths = write_dicom(tmp_path, stack())
    (tmp_path / name).touch()
    assert files_of(tmp_path) == sorted(paths)


def test_slices_of_a_tilted_gantry_are_read_with_a_warning_of_how_far_off_they_are(tmp_path: Path) -> None:
    write_moved(tmp_path, stack(), (0.0, 0.5, 0.0))
    (warning,) = warnings_of(tmp_path)
    assert "shifted against the first by 3.5 mm" in warning


def test_rounded_positions_are_no_shift(tmp_path: Path) -> None:
    write_moved(tmp_path, stack(), (0.0, 0.01, 0.0))
    assert warnings_of(tmp_path) == []


def test_a_slice_that_is_there_twice_is_named(tmp_path: Path) -> None:
    paths = write_dicom(tmp_path, stack())
    shutil.copy(paths[3], tmp_path / "again.dcm")
    with pytest.raises(InputError, match=r"two slices at one place: 003\.dcm and again\.dcm"):
        read_volume(tmp_path)


def test_slices_of_another_size_are_named(tmp_path: Path) -> None:
    write_dicom(tmp_path, stack(3))
    smaller = Scan(stack(3).array[:, :5], np.array([1.0, 1.0, 3.0]), np.eye(3), np.array([0.0, 0.0, 9.0]), ([0] * 3, [0] * 3))
    write_dicom(tmp_path, smaller, first=3)
    with pytest.raises(InputError, match=r"000\.dcm with 7×6 and 003\.dcm with 7×5 pixels"):
        read_volume(tmp_path)


def test_slices_in_several_directions_are_no_volume(tmp_path: Path) -> None:
    write_dicom(tmp_path, stack(3))
    write_dicom(tmp_path, stack(3, SAGITTAL), first=3)
    with pytest.raises(InputError, match="not parallel"):
        read_volume(tmp_path)


def test_distances_are_those_along_the_stack_whatever_order_the_files_have(tmp_path: Path) -> None:
    for number, path in enumerate(write_dicom(tmp_path, stack())):
        path.rename(tmp_path / f"{(5 * number) % 8}.dcm")
    assert warnings_of(tmp_path) == []
    (tmp_path / "2.dcm").unlink()
    (warning,) = warnings_of(tmp_path)
    assert "vary from 3.00 to 6.00 mm" in warning


def test_a_series_with_a_missing_slice_is_read_with_a_warning(
    tmp_path: Path, real_volume: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    for index, file in enumerate(sorted(real_volume("torso_dicom").iterdir())):
        if index != 7:
            (tmp_path / file.name).write_bytes(file.read_bytes())
    with caplog.at_level(logging.WARNING):
        read_volume(tmp_path)
    assert "slices may be missing" in caplog.text


def test_a_series_whose_last_slice_was_cut_off_is_read_with_a_warning(
    tmp_path: Path, real_volume: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    files = [Path(name) for name in sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(real_volume("torso_dicom")))]
    for file in files:
        content = file.read_bytes()
        (tmp_path / file.name).write_bytes(content if file != files[-1] else content[:3000])
    with caplog.at_level(logging.WARNING):
        assert read_volume(tmp_path).shape[0] == len(files) - 1
    assert f"without a slice that can be read: 1, such as {files[-1].name}" in caplog.text
