"""Small outlines: which slices they are drawn in, which part is meant, and what becomes of the figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.small_structures.report import CLOSELY, LITTLE, MUCH, WHOLE, write_report
from Benchmarks.small_structures.run import _little, _meant, _small_outlines
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume

SHAPE = (24, 60, 60)


def ball(k: int, j: int, i: int, radius: float) -> np.ndarray:
    kk, jj, ii = np.ogrid[: SHAPE[0], : SHAPE[1], : SHAPE[2]]
    return (kk - k) ** 2 + (jj - j) ** 2 + (ii - i) ** 2 <= radius**2


def labelled(structure: np.ndarray) -> LabelledVolume:
    volume = Volume(np.random.default_rng(0).normal(size=SHAPE), Geometry(SHAPE, np.diag([5.0, 5.0, 5.0, 1.0])))
    return LabelledVolume(volume, structure.astype(np.uint8), ("gland",))


def test_slices_that_show_little_are_those_near_the_poles() -> None:
    shown = np.flatnonzero(_little(ball(12, 30, 30, 10.0)).any(axis=(1, 2)))
    assert shown.tolist() == [3, 21], (
        "a tenth and a fifth of the largest area; 2 and 22 show a voxel, 4 and 20 more than a third"
    )


def test_of_two_large_parts_the_larger_one_is_meant_and_small_ones_go_along() -> None:
    larger, smaller, speck = ball(12, 15, 15, 8.0), ball(12, 45, 45, 7.0), ball(12, 45, 45, 2.0)
    np.testing.assert_array_equal(_meant(labelled(larger | smaller)).truth == 1, larger)
    np.testing.assert_array_equal(_meant(labelled(larger | speck)).truth == 1, larger | speck)


def test_outlines_are_measured_where_they_are_small_for_the_cells_of_the_scan() -> None:
    # Cells of a voxel.
    small = [(said["slice"], said["path"]) for said, *_ in _small_outlines(labelled(ball(12, 30, 30, 1.5)), 2)]
    assert (MUCH, 1) in small
    large = [said for said, *_ in _small_outlines(labelled(ball(12, 30, 30, 10.0)), 2) if said["slice"] == MUCH]
    assert large == []


def run(agreement: float, whole: float, closely: float, slice_: str = MUCH, case: str = "scan") -> dict[str, Any]:
    dice = {way: dict.fromkeys("123", mean) for way, mean in ((WHOLE, whole), (CLOSELY, closely))}
    return {"case": case, "structure": "gland", "slice": slice_, "path": 1, "agreement": agreement, **dice}


def test_the_figures_are_means_of_what_begins_and_of_what_stays(tmp_path: Path) -> None:
    runs = [run(0.2, 0.1, 0.7), run(0.79, 0.5, 0.4), run(0.8, 0.9, 0.6), run(0.1, 0.3, 0.5, LITTLE, "other")]
    write_report({"model": "m", "machine": machine(), "paths": 1, "runs": runs}, tmp_path)
    summary = json.loads((tmp_path / "small_structures.json").read_text(encoding="utf-8"))["summary"]
    begins, stays = summary[MUCH]["begins"]["all"], summary[MUCH]["stays"]["all"]
    assert (begins["outlines"], begins[WHOLE]["1"], begins[CLOSELY]["3"], begins["lost"]) == (2, 0.3, 0.55, 0.5)
    assert (stays["outlines"], stays[WHOLE]["1"], stays["lost"]) == (1, 0.9, 1.0)
    assert summary[LITTLE]["begins"]["other"][CLOSELY]["2"] == 0.5
    assert "other" not in summary[MUCH]["begins"]
    report = (tmp_path / "small_structures.md").read_text(encoding="utf-8")
    assert "| begins | all | 2 | 0.300 | 0.300 | 0.300 | 0.550 | 0.550 | 0.550 | 50% |" in report
