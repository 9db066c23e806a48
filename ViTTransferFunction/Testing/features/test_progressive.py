"""Features that sharpen while the user works."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.errors import Cancelled
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features import progressive as module
from ViTTransferFunction.Logic.features.extraction import FeatureRun, extract_features
from ViTTransferFunction.Logic.features.extraction_plan import SliceBatch
from ViTTransferFunction.Logic.features.progressive import progressive_features
from ViTTransferFunction.Logic.features.settings import FeatureSettings, feature_key
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer

SETTINGS = FeatureSettings(grid=24, precision="float32")


@pytest.fixture(autouse=True)
def few_coarse_patches_and_small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "COARSE_PATCHES", 8)
    monkeypatch.setattr("ViTTransferFunction.Logic.features.extraction_plan.TOKENS_PER_BATCH", 1000)


@pytest.mark.parametrize(
    "of_layers", [{}, {"layer_step": 2}, {"every_slice": True, "grid": 12}], ids=["all layers", "half of them", "all slices"]
)
def test_the_last_features_are_those_of_a_direct_extraction(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, of_layers: dict[str, Any]
) -> None:
    settings = replace(SETTINGS, **of_layers)
    *_, last = progressive_features(spheres[0], tiny_network, settings)
    direct = extract_features(spheres[0], tiny_network, settings)
    np.testing.assert_array_equal(last.array, direct.array)
    assert last.key == direct.key


def test_features_come_closer_to_the_last_at_every_stage(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    stages = [features.array.astype(float) for features in progressive_features(spheres[0], tiny_network, SETTINGS)]
    assert len(stages) >= 4
    errors = [np.abs(stage - stages[-1]).mean() for stage in stages]
    assert errors == sorted(errors, reverse=True)
    assert len(set(errors)) == len(errors)


def test_all_stages_lie_on_the_same_cells_and_only_the_last_has_the_settings_key(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    stages = list(progressive_features(spheres[0], tiny_network, SETTINGS))
    assert len({stage.array.shape for stage in stages}) == 1
    key = feature_key(spheres[0], tiny_network.model.name, tiny_network.weights_digest, SETTINGS, tiny_network.device)
    assert [stage.key == key for stage in stages] == [False] * (len(stages) - 1) + [True]
    assert len({stage.key for stage in stages}) == len(stages)


def test_slices_through_the_middle_come_first(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    volume = spheres[0]
    middle = volume.geometry.ijk_to_ras_points((np.array([volume.shape[::-1]]) - 1.0) / 2.0)[0]
    distances_mm: list[float] = []
    run = FeatureRun.run

    def noted(of: FeatureRun, batch: SliceBatch) -> None:
        distances_mm.append(of.distance_mm(batch, middle))
        run(of, batch)

    monkeypatch.setattr(FeatureRun, "run", noted)
    list(progressive_features(volume, tiny_network, SETTINGS))
    fine = distances_mm[-len(FeatureRun(volume, tiny_network, SETTINGS).batches) :]
    assert fine == sorted(fine)
    assert fine[0] < fine[-1]


def test_cancelling_leaves_the_features_of_the_stage_before(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    calls = 0

    def cancel_later(done: int, total: int, what: str) -> None:
        nonlocal calls
        calls += 1
        if calls > len(FeatureRun(spheres[0], tiny_network, SETTINGS).batches):
            raise Cancelled

    stages = progressive_features(spheres[0], tiny_network, SETTINGS, progress=cancel_later)
    before = [next(stages)]
    with pytest.raises(Cancelled):
        before.extend(stages)
    assert np.isfinite(before[-1].array).all()


def test_few_patches_are_run_at_once(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    assert len(list(progressive_features(spheres[0], tiny_network, FeatureSettings(grid=8)))) == 1
