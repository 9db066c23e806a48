"""The figures that the benchmark of features sums up, where settings were run on some of the volumes only."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")

from Benchmarks.features.report import write_report
from Benchmarks.features.run import DEFAULT, summary
from Benchmarks.features.runs import PUBLISHED, REFERENCE, at_grid, settings_called
from Benchmarks.shared.machine import machine
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS


def row(case: str, setting: str, seconds: float, dice: float, extra_bytes: int = 0) -> dict[str, Any]:
    cost = {"seconds": seconds, "estimated_seconds": seconds, "tokens": 1000, "feature_bytes": 10}
    memory = {"peak_bytes": 10 + extra_bytes, "estimated_peak_bytes": 10}
    worth = {"centred": 0.1, "whitened": 0.2, "dice": dict.fromkeys(("1", "3", "5", "10"), dice)}
    return {"case": case, "setting": setting, **cost, **memory, **worth}


@pytest.fixture
def report() -> dict[str, Any]:
    """Two volumes, one of which the published method was run on."""
    rows = [
        row("chest", PUBLISHED, 900.0, 0.80),
        row("chest", REFERENCE, 200.0, 0.84),
        row("chest", DEFAULT, 9.0, 0.82, extra_bytes=300),
        row("head", REFERENCE, 300.0, 0.74),
        row("head", DEFAULT, 10.0, 0.70, extra_bytes=200),
    ]
    return {
        "model": "m",
        "machine": machine("cpu"),
        "command": "python dev.py bench features",
        "default": DEFAULT,
        "published_cases": ["chest"],
        "rows": rows,
        "first_maps": [
            {"case": c, "voxels": [1, 2, 3], "first_map_s": s, "last_map_s": 9.0} for c, s in (("chest", 4.0), ("head", 5.0))
        ],
        "stages": {"case": "chest", "stages": [{"seconds": 1.0, "error": 0.5}]},
        "scaling": [{"size": 128, "tokens": 10, "seconds": 1.0, "peak_bytes": 20, "feature_bytes": 10}],
    }


def test_figures_against_the_published_way_are_over_the_volumes_that_it_was_run_on(report: dict[str, Any]) -> None:
    figures = summary(report)
    assert figures["speedup_vs_published"] == pytest.approx(100.0)
    assert figures["dice_loss"] == pytest.approx(-0.02)
    assert figures["dice_loss_vs_every_slice"] == pytest.approx(0.03)
    assert figures["dice_loss_worst_volume_vs_every_slice"] == pytest.approx(0.04)
    assert (figures["first_map_s"], figures["extra_memory_bytes"]) == (5.0, 300)


def test_without_the_published_way_there_are_no_figures_against_it(report: dict[str, Any]) -> None:
    report["rows"] = [row for row in report["rows"] if row["setting"] != PUBLISHED]
    assert not {"speedup_vs_published", "dice_loss"} & summary(report).keys()


@pytest.mark.parametrize(("cases", "words"), [(["chest"], "against *published* over chest"), ([], "it was not run")])
def test_the_report_says_what_was_compared(report: dict[str, Any], cases: list[str], words: str, tmp_path: Path) -> None:
    report |= {"published_cases": cases, "summary": summary(report)}
    write_report(report, tmp_path)
    assert words in (tmp_path / "features.md").read_text(encoding="utf-8")


def test_a_grid_is_the_default_setting_but_for_its_cells() -> None:
    default = PRESETS[DEFAULT_PRESET].features
    assert settings_called(DEFAULT) == default
    assert settings_called(at_grid(96)) == replace(default, grid=96)


def test_grids_have_rows_and_change_no_other_figure(report: dict[str, Any], tmp_path: Path) -> None:
    figures = summary(report)
    report["rows"].append(row("chest", at_grid(96), 30.0, 0.85))
    assert summary(report) == figures
    write_report({**report, "summary": figures}, tmp_path)
    assert "| chest | grid 96 | 1,000 | 30.0 |" in (tmp_path / "features.md").read_text(encoding="utf-8")
