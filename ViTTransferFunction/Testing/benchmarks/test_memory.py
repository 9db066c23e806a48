"""The scan of any size that memory is measured on."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from Benchmarks.features import run as features
from Benchmarks.memory import run as memory
from Benchmarks.memory.run import summary
from Benchmarks.memory.stretched_scan import NOISE_HU, write_points, write_stretched_scan
from Benchmarks.shared.cache_of_its_own import cache_of_its_own
from Benchmarks.solver import run as solver


def test_a_stretched_scan_fills_the_same_box_and_points_lie_in_their_structures(tmp_path: Path) -> None:
    labels = np.zeros((40, 50, 60), dtype=np.uint8)
    labels[2:36, 5:45, 3:28], labels[2:36, 5:45, 32:57] = 3, 7
    for name, array in (("scan.nrrd", 100 * labels.astype(np.int32)), ("labels.nrrd", labels)):
        image = sitk.GetImageFromArray(array)
        image.SetSpacing([2.0, 3.0, 4.0])
        image.SetOrigin([10.0, -20.0, 5.0])
        sitk.WriteImage(image, str(tmp_path / name))
    write_stretched_scan(tmp_path / "scan.nrrd", (80, 90, 70), tmp_path / "large.nrrd")
    write_points(tmp_path / "labels.nrrd", {"left": [3], "right": [7]}, tmp_path / "points.json")

    large = sitk.ReadImage(str(tmp_path / "large.nrrd"))
    assert large.GetSize() == (80, 90, 70)
    assert large.GetPixelID() == sitk.sitkInt16
    np.testing.assert_allclose(large.TransformContinuousIndexToPhysicalPoint([-0.5] * 3), [9.0, -21.5, 3.0])
    np.testing.assert_allclose(large.TransformContinuousIndexToPhysicalPoint([79.5, 89.5, 69.5]), [129.0, 128.5, 163.0])
    for entry, value in zip(json.loads((tmp_path / "points.json").read_text())["classes"], (300, 700), strict=True):
        assert len(entry["positive"]) == 3
        for point in entry["positive"]:
            assert abs(large[large.TransformPhysicalPointToIndex(point)] - value) < 6 * NOISE_HU


def test_the_largest_volume_counts() -> None:
    rows = [
        {"volume_gb": 0.6, "peak_gb": 1.9, "panel_peak_gb": 2.8},
        {"volume_gb": 0.2, "peak_gb": 1.1, "panel_peak_gb": 1.5},
    ]
    assert summary(rows) == {"largest_volume_gb": 0.6, "peak_gb": 1.9, "panel_peak_gb": 2.8}


def test_after_each_measurement_the_users_cache_and_weights_are_theirs_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VITTF_CACHE", "of the user")
    monkeypatch.setenv("VITTF_WEIGHTS", "of the user, too")
    before = dict(os.environ)
    with cache_of_its_own() as cache:
        assert os.environ["VITTF_CACHE"] == str(cache)
        assert "VITTF_WEIGHTS" not in os.environ
    assert dict(os.environ) == before


@pytest.mark.parametrize("main", [features.main, memory.main, solver.main])
def test_where_memory_cannot_be_counted_nothing_is_measured(
    main: Callable[[], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(sys, "argv", ["run", "--volumes", str(tmp_path), "--results", str(tmp_path)])
    with pytest.raises(SystemExit, match="run it there"):
        main()
