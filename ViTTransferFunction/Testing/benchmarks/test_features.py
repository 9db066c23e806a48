"""What the benchmark of features sums up, and how it measures."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from Benchmarks.features.capabilities import CAPABILITIES, capabilities_here
from Benchmarks.features.generated_volumes import AIR_HU, GENERATED, GeneratedVolume
from Benchmarks.features.report import write_report
from Benchmarks.features.settings import DEFAULT, FINE, SETTINGS, at_grid, settings_called
from Benchmarks.features.summary import summary
from Benchmarks.features.times import measured, sampled_seconds
from Benchmarks.features.waiting import waited
from Benchmarks.shared.machine import machine
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.cost import NetworkSpeed, calibrate
from ViTTransferFunction.Logic.features.extraction import FeatureRun
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.settings import SessionSettings


def row(case: str, setting: str, dice: tuple[float, float], extra_bytes: int = 0) -> dict[str, Any]:
    """Of two paths of clicks."""
    cost = {"seconds": 2.0, "estimated_seconds": 2.0, "tokens": 1000, "feature_bytes": 10}
    memory = {"peak_bytes": 10 + extra_bytes, "estimated_peak_bytes": 10}
    paths = [dict.fromkeys(("1", "3", "5", "10"), of_path) for of_path in dice]
    return {"case": case, "setting": setting, **cost, **memory, "centred": 0.1, "whitened": 0.2, "dice": paths}


def times(volume: str, seconds: float, first_map_s: float, published: float | None = None) -> dict[str, Any]:
    said = {"estimated_seconds": 2.0 * seconds, "calibration_s": 0.2, "tokens": 20_000}
    of_volume = {"volume": volume, "voxels": [4, 5, 6], "precision": "float32", "capability": "AVX2", "capability_key": "avx2"}
    found = {"seconds": seconds, "first_map_s": first_map_s}
    return {**of_volume, **found, **said, **({"published_seconds": published} if published else {})}


@pytest.fixture
def report() -> dict[str, Any]:
    return {
        "model": "m",
        "machine": machine("cpu"),
        "command": "python dev.py bench features",
        "paths": 2,
        "times": [times("amos_0336", 5.0, 1.5, published=1000.0), times("brain", 8.0, 2.0)],
        "rows": [
            row("amos_0336", FINE, (0.80, 0.90), extra_bytes=900),
            row("amos_0336", DEFAULT, (0.82, 0.90), extra_bytes=300),
            row("brain", FINE, (0.60, 0.60), extra_bytes=900),
            row("brain", DEFAULT, (0.57, 0.57), extra_bytes=200),
        ],
    }


def test_times_are_summed_up_for_each_class_of_processors(report: dict[str, Any]) -> None:
    figures = summary(report)
    assert (figures["seconds_amos_avx2"], figures["seconds_worst_avx2"], figures["first_map_s_avx2"]) == (5.0, 8.0, 2.0)
    assert figures["speedup_vs_published_avx2"] == pytest.approx(200.0)
    assert figures["estimate_off_by_avx2"] == pytest.approx(2.0)
    assert "seconds_amos_no_amx" not in figures


def test_dice_is_compared_with_the_previous_default_on_every_volume_and_path(report: dict[str, Any]) -> None:
    figures = summary(report)
    assert figures["dice_change_vs_previous_default"] == pytest.approx((0.01 - 0.03) / 2.0)
    assert figures["dice_change_vs_previous_default_worst_volume"] == pytest.approx(-0.03)
    assert figures["extra_memory_bytes"] == 300


def test_the_report_has_a_line_for_each_run(report: dict[str, Any], tmp_path: Path) -> None:
    report["rows"].append(row("brain", at_grid(96), (0.5, 0.7)))
    write_report({**report, "summary": summary(report)}, tmp_path)
    text = (tmp_path / "features.md").read_text(encoding="utf-8")
    assert "| AVX2 | amos_0336 | 4×5×6 | float32 | 20,000 | 1.5 | 5.0 | 10.0 | 0.20 | 1000 | 200 |" in text
    assert "| AVX2 | brain | 4×5×6 | float32 | 20,000 | 2.0 | 8.0 | 16.0 | 0.20 | – | – |" in text
    assert "| brain | grid 96 | 1,000 | 2.0 |" in text
    assert "| 0.600 ± 0.100 |" in text


def test_a_grid_is_the_default_setting_but_for_its_cells() -> None:
    default = PRESETS[DEFAULT_PRESET].features
    assert settings_called(DEFAULT) == default
    assert settings_called(at_grid(96)) == default.with_grid(96)
    assert len(set(SETTINGS.values())) == len(SETTINGS)


def test_a_processor_stands_for_classes_that_it_has_everything_of() -> None:
    assert all(capability in CAPABILITIES for capability in capabilities_here())
    for less, more in itertools.pairwise(CAPABILITIES[1:]):
        assert set(less.needs) < set(more.needs)


def test_generated_bodies_have_air_around_them_or_none() -> None:
    body, crop = (replace(volume, shape=(3, 40, 50)).volume().array for volume in GENERATED)
    assert 0.4 < np.mean(body == AIR_HU) < 0.75
    assert (body[:, 0] == AIR_HU).all()
    assert not (crop == AIR_HU).all(axis=(0, 1)).any()
    again = GeneratedVolume("again", (3, 40, 50), (1.0, 1.0, 1.0), GENERATED[0].semi_axes).volume().array
    np.testing.assert_array_equal(again, body)


def test_times_are_of_every_step_that_is_named(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(network: VisionTransformer, settings: FeatureSettings) -> NetworkSpeed:
        """A thousand seconds for each slice: whatever else is measured for an estimate does not matter then."""
        calibrate(network, settings)
        return NetworkSpeed(np.array([1000.0, 0.0, 0.0]))

    monkeypatch.setattr("Benchmarks.features.times.calibrate", slow)
    found = measured(spheres[0], tiny_network, published=False)
    assert all(found[name] > 0.0 for name in ("calibration_s", "first_map_s", "seconds", "with_coarse_s"))
    assert 1000.0 < found["estimated_seconds"] < found["estimated_with_coarse_s"]
    assert "published_seconds" not in found


def test_seconds_from_some_slices_stand_for_all_of_them(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = FeatureSettings(grid=20, merge_background=False, precision="float32")
    clock = itertools.count()
    # A second for each look at the clock: each axis takes one, however many of its slices are run.
    monkeypatch.setattr("Benchmarks.features.times.time.perf_counter", lambda: float(next(clock)))
    shape = FeatureRun(spheres[0], tiny_network, settings).plan.shape
    expected = sum(layers / 4 for layers in shape)
    assert sampled_seconds(spheres[0], tiny_network, settings, slices=4) == pytest.approx(expected, rel=0.3)


@pytest.mark.slow
def test_a_users_wait_is_measured_with_what_was_said_of_it(spheres: tuple[Volume, np.ndarray], real_weights: Path) -> None:
    found = waited(spheres[0], SessionSettings(grid=12, weights_path=str(real_weights), device="cpu"), starting_s=0.0)
    assert 0.0 < found["first_features_s"] <= found["ready_s"]
    assert all(found[name] > 0 for name in ("estimating_s", "said_s", "bytes", "said_bytes"))
