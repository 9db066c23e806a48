"""Where points are placed that are placed at once, and what becomes of the figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from Benchmarks.points_at_once.deep_points import deep_points
from Benchmarks.points_at_once.report import ALONE, STEPPED, WAYS, write_report
from Benchmarks.points_at_once.run import points_of
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine

SPACING_MM = (4.0, 1.0, 1.0)


def bar() -> np.ndarray:
    """A bar along I, 61 mm long, 21 mm wide and 20 mm high."""
    found = np.zeros((9, 40, 80), dtype=bool)
    found[2:7, 10:31, 10:71] = True
    return found


def test_points_are_deep_and_apart() -> None:
    structure = bar()
    points = np.array(deep_points(structure, SPACING_MM, 5)) * SPACING_MM
    assert structure[tuple((points / SPACING_MM).astype(int).T)].all()
    apart = np.linalg.norm(points[:, None] - points, axis=-1)[~np.eye(5, dtype=bool)]
    assert apart.min() > 8.0
    # Along the middle of the bar, where it is 10 mm deep, as long as there is room.
    np.testing.assert_allclose(points[:3, :2], [(16.0, 20.0)] * 3, atol=1.0)


def test_the_first_ones_are_the_same_however_many_there_are() -> None:
    assert deep_points(bar(), SPACING_MM, 5)[:3] == deep_points(bar(), SPACING_MM, 3)


def test_a_single_voxel_gets_all_points() -> None:
    structure = np.zeros((3, 4, 5), dtype=bool)
    structure[1, 2, 3] = True
    assert deep_points(structure, SPACING_MM, 3) == [(1, 2, 3)] * 3


def test_every_structure_has_as_many_points_all_inside(labelled: LabelledVolume) -> None:
    clicks = points_of(labelled)
    for count in (1, 3, 5):
        for label, of_structure in enumerate(clicks.at(count), start=1):
            assert len({click.kji for click in of_structure}) == count
            assert all(click.positive and labelled.truth[click.kji] == label for click in of_structure)


def run(way: str, dice: float) -> dict[str, Any]:
    rounds = {str(count): {"liver": {"dice": dice}, "spleen": {"dice": dice - 0.1}} for count in (1, 3, 5)}
    return {"case": "scan", "way": way, "rounds": rounds}


def test_the_report_has_points_alone_and_with_a_step(tmp_path: Path) -> None:
    write_report({"model": "m", "machine": machine()}, [run(way, 0.6 + 0.1 * WAYS.index(way)) for way in WAYS], tmp_path)
    text = (tmp_path / "points_at_once.md").read_text(encoding="utf-8")
    assert "| scan | 0.550 | 0.550 | 0.550 | 0.650 | 0.650 | 0.650 |" in text
    assert "| spleen | 0.500 |" in text
    summary = json.loads((tmp_path / "points_at_once.json").read_text(encoding="utf-8"))["summary"]
    assert (summary["mean"][ALONE]["1"], summary["cases"]["scan"][STEPPED]["5"]) == pytest.approx((0.55, 0.65))
