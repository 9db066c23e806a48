"""Coarse features first, then those that were asked for."""

from __future__ import annotations

import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features import progressive as module
from ViTTransferFunction.Logic.features.accumulation import FeatureSums
from ViTTransferFunction.Logic.features.cost import NetworkSpeed, feature_cost
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.progressive import progressive_cost, progressive_features
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer

SETTINGS = FeatureSettings(grid=12, precision="float32")


@pytest.fixture(autouse=True)
def few_coarse_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "COARSE_PATCHES", 6**3)


@pytest.mark.parametrize("of_layers", [{}, {"layer_step": 2}, {"every_slice": True}], ids=["all", "half of them", "all slices"])
def test_coarse_features_on_the_same_cells_come_before_those_of_a_direct_extraction(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, of_layers: dict[str, Any]
) -> None:
    settings = replace(SETTINGS, **of_layers)
    coarse, last = progressive_features(spheres[0], tiny_network, settings)
    direct = extract_features(spheres[0], tiny_network, settings)
    np.testing.assert_array_equal(last.array, direct.array)
    assert last.key == direct.key
    assert coarse.geometry.shape < direct.geometry.shape
    assert coarse.cells.shape == direct.cells.shape
    # No cache takes the coarse ones for those that were asked for.
    assert coarse.key != direct.key


def test_cancelling_leaves_the_coarse_features(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    cancelled = False

    def progress(done: int, total: int, what: str) -> None:
        if cancelled:
            raise Cancelled

    stages = progressive_features(spheres[0], tiny_network, SETTINGS, progress)
    coarse = next(stages)
    cancelled = True
    with pytest.raises(Cancelled):
        next(stages)
    assert np.isfinite(coarse.array).all()


def test_progress_counts_coarse_and_fine_features_together(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    told: list[tuple[int, int]] = []
    stages = progressive_features(spheres[0], tiny_network, SETTINGS, lambda done, total, what: told.append((done, total)))
    next(stages)
    coarse_done, total = told[-1]
    # Otherwise the panel would say that a second is left, and then a minute.
    assert 0 < coarse_done < total / 4
    assert len(list(stages)) == 1
    assert [each for each, _ in told] == sorted(each for each, _ in told)
    assert {each for _, each in told} == {total}
    assert told[-1] == (total, total)


def test_while_features_are_used_neither_weights_in_their_precision_nor_their_sums_are_in_memory(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights, sums = weakref.WeakSet[VisionTransformer](), weakref.WeakSet[FeatureSums]()
    convert, begin = VisionTransformer.converted, FeatureSums.__init__

    def converted(network: VisionTransformer, device: torch.device | str, dtype: torch.dtype) -> VisionTransformer:
        in_precision = convert(network, device, dtype)
        if in_precision is not tiny_network:
            assert not weights
            weights.add(in_precision)
        return in_precision

    def sums_begin(of_stage: FeatureSums, *arguments: Any) -> None:
        begin(of_stage, *arguments)
        sums.add(of_stage)

    monkeypatch.setattr(module, "_coarse", lambda settings: replace(settings, grid=6))
    monkeypatch.setattr(VisionTransformer, "converted", converted)
    monkeypatch.setattr(FeatureSums, "__init__", sums_begin)
    # The sums of the last stage are there from the beginning, but take no memory before they are written to.
    in_use = [
        (len(weights), len(sums))
        for _ in progressive_features(spheres[0], tiny_network, replace(SETTINGS, precision="bfloat16"))
    ]
    assert in_use == [(0, 1), (0, 0)]


def test_few_patches_are_run_at_once(spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer) -> None:
    assert len(list(progressive_features(spheres[0], tiny_network, replace(SETTINGS, grid=6)))) == 1


def test_the_coarse_features_are_part_of_what_is_said_to_be_the_cost(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    speed = NetworkSpeed(np.array([0.0, 1.0, 0.0]))
    cost, fine = (of(spheres[0], SETTINGS, tiny_network, speed) for of in (progressive_cost, feature_cost))
    coarse_tokens = cost.tokens - fine.tokens
    assert 0 < coarse_tokens < fine.tokens
    # A second for each patch; besides, preparing them is timed.
    assert cost.seconds > fine.tokens + coarse_tokens
    assert cost.peak_bytes == fine.peak_bytes
    few = replace(SETTINGS, grid=6)
    assert (
        progressive_cost(spheres[0], few, tiny_network, speed).tokens
        == feature_cost(spheres[0], few, tiny_network, speed).tokens
    )
