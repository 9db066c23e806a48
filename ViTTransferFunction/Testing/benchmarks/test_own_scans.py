"""Scans of the user's own, with Slicer segmentations beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from Benchmarks.own_scans.own_scan import OwnScan, own_scans
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.segmentation_files import Segment, write_segmentation

GEOMETRY = Geometry((20, 24, 28), np.diag([-1.0, -1.0, 2.0, 1.0]))


@pytest.fixture
def labels() -> np.ndarray:
    """A box, a speck, and another box."""
    found = np.zeros(GEOMETRY.shape, dtype=np.uint8)
    found[2:10, 2:10, 2:10], found[15, 15, 15], found[12:18, 2:8, 14:20] = 1, 2, 3
    return found


def write_scan(folder: Path, name: str, labels: np.ndarray) -> None:
    """A scan, and its segmentation, of which only the box is stored that segments fill."""
    image = sitk.GetImageFromArray(np.random.default_rng(0).normal(100.0 * labels, 5.0).astype(np.float32))
    image.SetSpacing((1.0, 1.0, 2.0))
    sitk.WriteImage(image, str(folder / f"{name}.nii.gz"))
    part = Geometry((18, 20, 22), GEOMETRY.ijk_to_ras)
    segments = [Segment(each, (1.0, 0.0, 0.0)) for each in ("liver", "speck", "spleen")]
    write_segmentation(folder / f"{name}.seg.nrrd", labels[:18, :20, :22], part, segments)


def test_segments_lie_where_they_do_in_the_scan_and_specks_are_left_out(tmp_path: Path, labels: np.ndarray) -> None:
    write_scan(tmp_path, "case 1", labels)
    labelled = OwnScan("case 1").read(tmp_path)
    assert labelled.names == ("liver", "spleen")
    np.testing.assert_array_equal(labelled.truth, np.select([labels == 1, labels == 3], [1, 2]))
    assert labelled.volume.array[labelled.truth == 2].mean() == pytest.approx(300.0, abs=2.0)


def test_all_scans_of_a_folder_are_found_by_their_segmentations(tmp_path: Path, labels: np.ndarray) -> None:
    for name in ("b", "a.1"):
        write_scan(tmp_path, name, labels)
    (tmp_path / "without.nii.gz").touch()
    (tmp_path / "._b.seg.nrrd").touch()
    assert [scan.name for scan in own_scans(tmp_path)] == ["a.1", "b"]


@pytest.mark.parametrize("ending", [".nhdr", ".mhd", ".hdr", ".NRRD"])
def test_a_scan_may_be_of_any_format_that_a_cohort_takes(tmp_path: Path, labels: np.ndarray, ending: str) -> None:
    write_scan(tmp_path, "a", labels)
    read = sitk.ReadImage(str(tmp_path / "a.nii.gz"))
    (tmp_path / "a.nii.gz").unlink()
    sitk.WriteImage(read, str(tmp_path / f"a{ending.lower()}"))
    (tmp_path / f"a{ending.lower()}").rename(tmp_path / f"a{ending}")
    assert OwnScan("a").read(tmp_path).volume.shape == labels.shape


def test_two_scans_of_one_name_are_told_apart_by_the_user(tmp_path: Path, labels: np.ndarray) -> None:
    write_scan(tmp_path, "a", labels)
    sitk.WriteImage(sitk.ReadImage(str(tmp_path / "a.nii.gz")), str(tmp_path / "a.mha"))
    with pytest.raises(InputError, match=r"needs one scan of its name .*; found a\.mha, a\.nii\.gz"):
        OwnScan("a").read(tmp_path)


def test_more_segments_than_a_byte_tells_apart_stay_apart(tmp_path: Path, labels: np.ndarray) -> None:
    write_scan(tmp_path, "a", labels)
    many = np.zeros(GEOMETRY.shape, dtype=np.uint16)
    many.reshape(-1)[: 260 * 50] = np.repeat(np.arange(1, 261), 50)
    write_segmentation(tmp_path / "a.seg.nrrd", many, GEOMETRY, [Segment(f"s{n}", (1.0, 0.0, 0.0)) for n in range(1, 261)])
    labelled = OwnScan("a").read(tmp_path)
    assert labelled.names[-1] == "s260"
    np.testing.assert_array_equal(labelled.truth, many)


def test_what_is_missing_is_said(tmp_path: Path, labels: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"has no NAME\.seg\.nrrd; put scans there"):
        own_scans(tmp_path)
    write_scan(tmp_path, "a", labels)
    (tmp_path / "a.nii.gz").unlink()
    with pytest.raises(InputError, match=r"a\.seg\.nrrd needs one scan of its name .*\.nii\.gz, .*; found none"):
        OwnScan("a").read(tmp_path)
    write_scan(tmp_path, "a", np.where(labels == 2, labels, 0))
    with pytest.raises(InputError, match=r"No segment of a\.seg\.nrrd has 50 voxels"):
        OwnScan("a").read(tmp_path)
