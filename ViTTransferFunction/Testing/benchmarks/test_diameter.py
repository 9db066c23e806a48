"""Diameters as a simulated user draws them, and what becomes of the figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from Benchmarks.diameter.report import CLICKS, DIAMETER, WAYS, write_report
from Benchmarks.shared.drawn_diameter import drawn_diameter
from Benchmarks.shared.machine import machine
from Benchmarks.shared.simulated_clicker import Click

SPACING_MM = (5.0, 1.0, 1.0)
SHAPE = (6, 60, 80)


def ellipse(k: int, radius_j: float, radius_i: float) -> np.ndarray:
    """A flat ellipse in one slice, about its middle."""
    found = np.zeros(SHAPE, dtype=bool)
    j, i = np.ogrid[: SHAPE[1], : SHAPE[2]]
    found[k] = ((j - 30) / radius_j) ** 2 + ((i - 40) / radius_i) ** 2 <= 1.0
    return found


def voxels(clicks: list[Click], positive: bool) -> np.ndarray:
    return np.array([click.kji for click in clicks if click.positive == positive])


def test_the_longest_line_is_drawn_in_the_slice_that_shows_most() -> None:
    structure = ellipse(3, 10.0, 25.0) | ellipse(2, 5.0, 8.0)
    longest = drawn_diameter(structure, SPACING_MM, 1, 2)
    inside, outside = voxels(longest, True), voxels(longest, False)
    assert set(inside[:, 0]) == set(outside[:, 0]) == {3}
    # Points inside are on the long axis, the middle first, and those outside a fifth of it beyond its ends.
    np.testing.assert_allclose(inside[0], (3, 30, 40), atol=3)
    np.testing.assert_allclose(np.ptp(inside[:, 2]), 0.5 * 50, atol=4)
    np.testing.assert_allclose(sorted(outside[:, 2]), (5, 75), atol=5)
    assert structure[tuple(inside.T)].all()
    assert not structure[tuple(outside.T)].any()


def test_a_line_does_not_leave_what_is_bent() -> None:
    structure = ellipse(3, 25.0, 25.0) & ~ellipse(3, 18.0, 18.0)
    structure[:, 20:] = False
    for path in range(5):
        inside = voxels(drawn_diameter(structure, SPACING_MM, path, 1), True)
        near = [structure[k, max(j - 3, 0) : j + 4, i - 3 : i + 4].any() for k, j, i in inside]
        assert all(near)


def test_the_same_person_draws_the_same_and_another_one_another() -> None:
    structure = ellipse(3, 10.0, 25.0)
    assert drawn_diameter(structure, SPACING_MM, 1, 2) == drawn_diameter(structure, SPACING_MM, 1, 2)
    assert len({str(drawn_diameter(structure, SPACING_MM, path, 2)) for path in range(5)}) > 1


def test_what_lies_beyond_the_volume_is_left_out() -> None:
    structure = np.zeros(SHAPE, dtype=bool)
    structure[2, 20:30] = True
    assert [click.positive for click in drawn_diameter(structure, SPACING_MM, 1, 1)] == [True] * 3


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 2), (1, 9)])
def test_a_few_voxels_have_diameters_too(size: tuple[int, int]) -> None:
    structure = np.zeros(SHAPE, dtype=bool)
    structure[2, 20 : 20 + size[0], 20 : 20 + size[1]] = True
    middle = drawn_diameter(structure, SPACING_MM, 1, 1)[0]
    assert middle.positive
    assert structure[middle.kji]


def run(way: str, path: int, dice: float) -> dict[str, Any]:
    rounds = {str(number): {"liver": {"dice": dice}, "spleen": {"dice": dice - 0.1}} for number in range(1, 6)}
    return {"case": "scan", "way": way, "path": path, "rounds": rounds}


def test_the_report_has_each_way_by_gestures(tmp_path: Path) -> None:
    runs = [run(way, path, 0.6 + 0.1 * WAYS.index(way) + 0.02 * path) for path in (1, 2) for way in WAYS]
    write_report({"model": "m", "machine": machine(), "paths": 2}, runs, tmp_path)
    text = (tmp_path / "diameter.md").read_text(encoding="utf-8")
    assert "| scan | 0.580 ± 0.014 |" in text
    assert "| liver | 0.630 |" in text
    summary = json.loads((tmp_path / "diameter.json").read_text(encoding="utf-8"))["summary"]
    assert (summary["mean"][CLICKS]["1"], summary["mean"][DIAMETER]["1"]) == pytest.approx((0.58, 0.68))
    assert summary["cases"]["scan"][DIAMETER]["1"] == pytest.approx([0.68, 0.0141], abs=1e-4)
