"""Scans of the user's own, with Slicer segmentations beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from Benchmarks.own_scans.own_scan import OwnScan, own_scans
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.geometry import Geometry
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
    assert [scan.name for scan in own_scans(tmp_path)] == ["a.1", "b"]


def test_what_is_missing_is_said(tmp_path: Path, labels: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"has no NAME\.seg\.nrrd; put scans there"):
        own_scans(tmp_path)
    write_scan(tmp_path, "a", labels)
    (tmp_path / "a.nii.gz").unlink()
    with pytest.raises(InputError, match=r"no scan to a\.seg\.nrrd; expected one of .*a\.nii\.gz"):
        OwnScan("a").read(tmp_path)
    write_scan(tmp_path, "a", np.where(labels == 2, labels, 0))
    with pytest.raises(InputError, match=r"No segment of a\.seg\.nrrd has 50 voxels"):
        OwnScan("a").read(tmp_path)
