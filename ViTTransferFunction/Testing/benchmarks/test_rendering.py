"""Arithmetic of the rendering benchmark."""

from __future__ import annotations

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("skimage")

from Benchmarks.rendering.run import summary, text

MEASURED = {
    "machine": {"cores": 2},
    "opengl": "in software",
    "volume": 256,
    "pixels": 512,
    "making_ms": {"structures": 40.0, "light": 60.0},
    "drawn": {
        "own": {"first_ms": 900.0, "normal_ms": 800.0, "still_ms": 400.0, "turning_ms": 100.0},
        "structures": {"first_ms": 300.0, "normal_ms": 200.0, "still_ms": 100.0, "turning_ms": 50.0},
        "structures and surroundings": {"first_ms": 300.0, "normal_ms": 400.0, "still_ms": 200.0, "turning_ms": 125.0},
    },
    "changes": {
        "colour": {"picture_ms": 40.0, "edge_pixels": 2.0, "likeness": 0.99, "full_ms": 90.0, "itself_ms": 1.5},
        "preset": {"picture_ms": 30.0, "edge_pixels": 3.0, "likeness": 0.9876, "full_ms": 120.0, "itself_ms": 4.0},
    },
    "clicks": {
        "maps": {"median_ms": 60.0, "worst_ms": 100.0},
        "picture": {"median_ms": 290.0, "worst_ms": 350.0},
    },
}


def test_renderings_are_compared_with_slicers_own_of_the_same_run() -> None:
    assert summary(MEASURED) == {
        "change_ms": 4.0,
        "changed_picture_ms": 40.0,
        "changed_full_picture_ms": 120.0,
        "likeness": 0.9876,
        "making_ms": 100.0,
        "click_to_picture_ms": 290.0,
        "still_ratio": 0.25,
        "surroundings_still_ratio": 0.5,
        "turning_frames_per_s": 8.0,
    }


def test_the_report_has_times_and_ratios(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("Benchmarks.rendering.run.in_words", lambda machine: "a computer")
    report = text(MEASURED)
    assert "| structures | 300 ms (0.33) | 200 ms (0.25) | 100 ms (0.25) | 50 ms (0.50) |" in report
    assert "| preset | 30 ms | 3² pixels | 0.988 | 120 ms | 4 ms |" in report
    assert "| picture | 290 ms | 350 ms |" in report
