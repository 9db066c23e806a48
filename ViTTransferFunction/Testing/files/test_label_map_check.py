"""A map of labels that is opened as a scan is told; a scan is not, whatever it is like."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.files.label_map_check import LABEL_INTENT, looks_like_labels
from ViTTransferFunction.Logic.files.volume_files import read_volume

SHAPE = (20, 40, 40)
RANDOM = np.random.default_rng(0)
DISTANCE = np.sqrt(((np.indices(SHAPE) - np.array([[[[10]], [[20]], [[20]]]]).reshape(3, 1, 1, 1)) ** 2).sum(axis=0))
LABELS = (DISTANCE < 9).astype(np.uint8) + 4 * (DISTANCE < 5)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32, np.float64])
def test_labels_are_told_whatever_numbers_they_are_kept_in(dtype: type) -> None:
    assert looks_like_labels(LABELS.astype(dtype))
    assert looks_like_labels((LABELS > 0).astype(dtype))


def test_labels_of_thin_structures_are_told() -> None:
    vessels = np.zeros(SHAPE, dtype=np.uint8)
    vessels[:, 10:20, 10:12], vessels[:, 10:20, 20:22] = 1, 2
    assert looks_like_labels(vessels)


@pytest.mark.parametrize(
    "scan",
    [
        (50 * LABELS + RANDOM.normal(100.0, 5.0, SHAPE)).astype(np.uint8),
        (100 * LABELS + RANDOM.normal(-100.0, 5.0, SHAPE)).astype(np.int16),
        LABELS + 0.5,
        np.where(DISTANCE < 9, np.nan, LABELS),
        np.where(DISTANCE < 9, np.inf, LABELS),
        np.where(DISTANCE < 9, 0, -1000),
        np.arange(np.prod(SHAPE) // 8).reshape(20, 40, 5).repeat(8, axis=2),  # Even, of thousands of numbers.
        (np.indices(SHAPE) % 2).all(axis=0).astype(np.uint8),  # Specks.
        np.clip(RANDOM.normal(0.0, 3.0, SHAPE), 0, 7).astype(np.uint8),  # Of very few grey levels.
        (200 - 10 * DISTANCE).astype(np.int16),
    ],
)
def test_scans_are_not(scan: np.ndarray) -> None:
    assert not looks_like_labels(scan)


def test_whoever_opens_one_is_warned_and_has_it(tmp_path: Path) -> None:
    warnings: list[str] = []
    sitk.WriteImage(sitk.GetImageFromArray(LABELS), str(tmp_path / "organs.nii.gz"))
    volume = read_volume(tmp_path / "organs.nii.gz", warnings.append)
    assert volume.name == "organs"
    assert len(warnings) == 1
    assert "organs.nii.gz looks like a map of labels" in warnings[0]


def test_a_header_that_says_so_is_believed(tmp_path: Path) -> None:
    warnings: list[str] = []
    path = tmp_path / "parcels.nii"
    sitk.WriteImage(sitk.GetImageFromArray(RANDOM.integers(0, 30_000, SHAPE).astype(np.int16)), str(path))
    header = bytearray(path.read_bytes())
    header[68:70] = int(LABEL_INTENT).to_bytes(2, "little")
    path.write_bytes(header)
    read_volume(path, warnings.append)
    assert len(warnings) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torso_small_ct.nii.gz", "torso_small_labels.nii.gz"])
def test_real_ones_are_told_apart(real_volume: Callable[[str], Path], name: str) -> None:
    warnings: list[str] = []
    read_volume(real_volume(name), warnings.append)
    assert bool(warnings) == ("labels" in name)
