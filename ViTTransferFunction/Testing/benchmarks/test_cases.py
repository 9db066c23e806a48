"""The labelled volumes that accuracy is measured on."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from Benchmarks.accuracy.cases import ALL_CASES, GROUPS, group_of
from Benchmarks.shared.case_changes import thick_slices
from Benchmarks.shared.derived_cases import DerivedCase, OrganFillingCrop
from Benchmarks.shared.every_structure import LEAST_VOXELS, EveryStructureCase
from Benchmarks.shared.labelled_cases import CHEST, Case
from Benchmarks.shared.other_cases import OTHERS, MaskCase, cases_there, without_missing
from ViTTransferFunction.Logic.core.system.errors import InputError

SCAN = Case("scan", "scan.nrrd", "labels.nrrd", {"box": (7,)})


def write_scan(folder: Path) -> np.ndarray:
    """A volume with a large box of label 7, a small one of 8, and a speck of 9; returns the labels."""
    labels = np.zeros((20, 20, 20), dtype=np.uint8)
    labels[2:18, 2:18, 2:9] = 7
    labels[2:10, 2:10, 12:16] = 8
    labels[18, 18, 18] = 9
    intensities = np.random.default_rng(0).normal(100.0 * labels, 5.0)
    for name, array in (("scan", intensities), ("labels", labels)):
        image = sitk.GetImageFromArray(array)
        image.SetSpacing((2.0, 2.0, 2.0))
        sitk.WriteImage(image, str(folder / f"{name}.nrrd"))
    (folder / "names.json").write_text(json.dumps({"7": "Big_Box", "8": "small_box", "9": "speck"}), encoding="utf-8")
    return labels


def test_every_structure_that_is_large_enough_to_be_clicked_is_one(tmp_path: Path) -> None:
    labels = write_scan(tmp_path)
    labelled = EveryStructureCase("scan all", SCAN, "names.json").read(tmp_path)
    assert labelled.names == ("big box", "small box")
    np.testing.assert_array_equal(labelled.truth == 1, labels == 7)
    np.testing.assert_array_equal(labelled.truth == 2, labels == 8)
    assert np.count_nonzero(labels == 9) < LEAST_VOXELS


def test_scans_keep_apart_more_structures_than_a_byte_can_number(tmp_path: Path) -> None:
    labels = np.repeat(np.arange(1, 301, dtype=np.uint16), LEAST_VOXELS).reshape(20, 25, 30)
    for name, array in (("scan", np.random.default_rng(0).normal(size=labels.shape)), ("labels", labels)):
        image = sitk.GetImageFromArray(array)
        image.SetSpacing((4.0, 4.0, 4.0))
        sitk.WriteImage(image, str(tmp_path / f"{name}.nrrd"))
    names = {str(label): f"s{label}" for label in range(1, 301)}
    (tmp_path / "names.json").write_text(json.dumps(names), encoding="utf-8")
    every = EveryStructureCase("scan all", SCAN, "names.json").read(tmp_path)
    assert every.names == tuple(names.values())
    for labelled in (every, every.only(range(1, 301)), thick_slices(every, 4.0)):
        np.testing.assert_array_equal(labelled.truth, labels)
    case = Case("scan", "scan.nrrd", "labels.nrrd", {name: (int(label),) for label, name in names.items()})
    np.testing.assert_array_equal(case.read(tmp_path).truth, labels)


def test_a_derived_case_is_its_scan_changed(tmp_path: Path) -> None:
    labels = write_scan(tmp_path)
    half = DerivedCase("half", SCAN, lambda labelled: labelled.only([])).read(tmp_path)
    assert half.names == ()
    crop = OrganFillingCrop("crop", SCAN, ("box",)).read(tmp_path)
    assert crop.truth.sum() == (labels == 7).sum()
    assert crop.truth.size < labels.size


def test_structures_in_files_of_their_own_lie_where_they_do_in_the_scan(tmp_path: Path) -> None:
    labels = write_scan(tmp_path)
    everything = sitk.ReadImage(str(tmp_path / "labels.nrrd"))
    sitk.WriteImage(everything == 7, str(tmp_path / "large.nrrd"))
    sitk.WriteImage((everything == 8)[11:17, :, 1:], str(tmp_path / "small.nrrd"))
    labelled = MaskCase("scan", "scan.nrrd", {"large box": "large.nrrd", "small box": "small.nrrd"}).read(tmp_path)
    assert labelled.names == ("large box", "small box")
    np.testing.assert_array_equal(labelled.truth == 1, labels == 7)
    np.testing.assert_array_equal(labelled.truth == 2, labels == 8)


def test_only_the_other_scans_may_be_missing(tmp_path: Path) -> None:
    there = tmp_path / OTHERS[0].volume
    there.parent.mkdir(parents=True)
    there.touch()
    cases, left_out = without_missing(ALL_CASES, tmp_path)
    assert left_out == [case.name for case in OTHERS[1:]]
    assert [case.name for case in cases] == [case.name for case in ALL_CASES if case.name not in left_out]


def test_whoever_measures_is_told_which_scans_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cases_there([OTHERS[0], SCAN], tmp_path) == [SCAN]
    assert f"Not in {tmp_path}, and left out: {OTHERS[0].name}. docs/RESULTS.md says" in capsys.readouterr().out
    assert cases_there([SCAN], tmp_path) == [SCAN]
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("asked", "words"), [(OTHERS[:2], f"{OTHERS[0].name}, {OTHERS[1].name}"), ((), "scans of your own")])
def test_whoever_has_nothing_to_measure_is_told_what_to_do(asked: tuple[Case, ...], words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"looked in {re.escape(str(tmp_path))} for {words}. docs/RESULTS.md says"):
        cases_there(asked, tmp_path)
    assert cases_there(asked, tmp_path, own=[SCAN]) == [SCAN]


def test_a_chest_with_lungs_comes_with_a_package() -> None:
    chest = CHEST.read(Path("nowhere"))
    millilitres = np.count_nonzero(chest.truth == 1) * chest.volume.geometry.voxel_volume_mm3 / 1000.0
    assert chest.names[:2] == ("right lung", "left lung")
    # A man's, breathed in.
    assert 2000.0 < millilitres < 4000.0
    assert chest.volume.array[chest.truth == 1].mean() < -600.0


def test_cases_have_names_of_their_own_and_a_group() -> None:
    names = [case.name for case in ALL_CASES]
    assert len(set(names)) == len(names)
    for group in GROUPS:
        assert all(group_of(case.name) is group for case in group.cases)
