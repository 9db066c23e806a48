"""What the benchmark of interaction says of an update of the maps."""

from __future__ import annotations

from typing import Any

import pytest

from Benchmarks.interaction.update_cost import POINTS_BEFORE, measure_updates
from Benchmarks.shared.machine import machine

PACES = [{"pause_s": 0.1, "median_ms": 60.0, "worst_ms": 120.0}, {"pause_s": 1.0, "median_ms": 250.0, "worst_ms": 770.0}]


@pytest.fixture
def measured() -> dict[str, Any]:
    all_classes = {"median_ms": 300.0, "worst_ms": 800.0}
    clicks = {
        **{"paces": PACES, "all_classes": all_classes, "points": [5, 125]},
        **{"blocked_ms": 50.0, "features_loaded_s": 4.0, "refined_after_s": 1.5},
    }
    rows = [{"points": points, "first_ms": 20.0, "update_ms": 30.0 + points} for points in (5, 10)]
    updates = {"cells": 80, "classes": 5, "floor_ms": 10.0, "rows": rows}
    hand_over = {"median_s": 0.2, "worst_s": 0.45, "blocked_ms": 3.0}
    writing = {"segments": 5, "voxels": 1e6, "seconds": 1.5, "blocked_ms": 70.0}
    large = {"shape": (600, 512, 512), "hand_over": hand_over, "writing": writing}
    volume = {"machine": machine("cpu"), "volume": 256, "cells": 64, "classes": 5}
    opening = {"ready_s": 0.4, "ready_worst_s": 0.45, "first_map_s": 0.6, "first_map_worst_s": 0.75}
    slower = {name: 2.0 * seconds for name, seconds in opening.items()}
    return {
        **volume,
        "cached_opening": {"made up": opening, "scan": slower},
        "clicks": clicks,
        "updates": updates,
        "large_result": large,
    }


def test_updates_are_measured_for_every_number_of_points() -> None:
    updates = measure_updates(cells=8)
    assert [row["points"] for row in updates["rows"]] == list(POINTS_BEFORE)
    assert min(updates["floor_ms"], *(row["first_ms"] for row in updates["rows"])) > 0.0
    assert all(row["first_ms"] < row["update_ms"] for row in updates["rows"])


def test_the_slowest_update_is_what_is_tracked(measured: dict[str, Any]) -> None:
    pytest.importorskip("trame_slicer")
    from Benchmarks.interaction.run import summary

    figures = summary(measured)
    assert (figures["update_ms"], figures["update_floor_ratio"]) == (40.0, 4.0)
    assert (figures["click_ms"], figures["click_worst_ms"], figures["blocked_ms"]) == (250.0, 770.0, 70.0)
    assert (figures["cached_ready_s"], figures["cached_first_map_s"]) == (0.8, 1.2)


def test_the_report_has_what_the_user_waits_for_and_what_the_maps_cost(measured: dict[str, Any]) -> None:
    pytest.importorskip("trame_slicer")
    from Benchmarks.interaction.run import text

    report = text({**measured, "extraction": {"grid": 32, "seconds": 2.0, "blocked_ms": 3.0}})
    assert "median (slowest) | 250 ms (770 ms) |" in report
    assert "5 points in the beginning and 125 in the end" in report
    assert "2 s at grid 32 | 3 ms |" in report
    assert (
        "(made up), the panel being open, from choosing the volume to ready for clicks: median (slowest) | 0.40 s (0.45 s) |"
        in report
    )
    assert "labels of 512×512×600 voxels handed over: median (slowest) | 0.20 s (0.45 s) |" in report
    assert "all classes, at all paces: median (slowest) | 300 ms (800 ms) |" in report
    assert "| 10 | 20 ms | 40 ms | 4.0 |" in report
