"""What an extraction is said to cost before it runs."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.system.progress import Between
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features import cost as cost_module
from ViTTransferFunction.Logic.features.background_tokens import TokenSelection
from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.cost import NetworkSpeed, calibrate, feature_cost, feature_memory_bytes
from ViTTransferFunction.Logic.features.extraction import features_size_bytes
from ViTTransferFunction.Logic.features.extraction_plan import ExtractionPlan
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.slice_patches import SlicePatches
from ViTTransferFunction.Logic.features.vision_transformer import ROWS_AT_ONCE, VisionTransformer
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, TINY_ROTARY_MODEL, random_state_dict
from ViTTransferFunction.Testing.support.torch_threads import torch_threads

SPEED = NetworkSpeed(np.array([1e-3, 1e-3, 1e-7]))
SETTINGS = FeatureSettings(grid=24, merge_background=False)


@pytest.mark.parametrize(
    "from_cheap_to_expensive",
    [
        [replace(SETTINGS, grid=grid) for grid in (8, 12, 16, 24, 32)],
        [replace(SETTINGS, most_patches=3 * longest**3) for longest in (10, 14, 19, 24)],
        [replace(SETTINGS, layer_step=step) for step in (4, 3, 2, 1)],
        [SETTINGS, replace(SETTINGS, every_slice=True)],
        [replace(SETTINGS, merge_background=True), SETTINGS],
    ],
    ids=["grid", "patches", "layers", "slices", "background"],
)
def test_whatever_makes_more_tokens_costs_more(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, from_cheap_to_expensive: list[FeatureSettings]
) -> None:
    costs = [feature_cost(spheres[0], settings, tiny_network, SPEED) for settings in from_cheap_to_expensive]
    for cheap, expensive in itertools.pairwise(costs):
        assert cheap.tokens < expensive.tokens
        assert cheap.seconds < expensive.seconds
        assert cheap.peak_bytes <= expensive.peak_bytes


def test_tokens_are_those_of_every_slice_of_three_axes(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    cost = feature_cost(spheres[0], SETTINGS, tiny_network, SPEED)
    assert cost.tokens == 3 * np.prod(ExtractionPlan(spheres[0], SETTINGS).shape)


def test_the_features_themselves_are_part_of_the_memory(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    cost = feature_cost(spheres[0], SETTINGS, tiny_network, SPEED)
    assert cost.peak_bytes > features_size_bytes(spheres[0].geometry, SETTINGS, TINY_MODEL)


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_the_memory_is_known_without_the_weights(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, precision: Any
) -> None:
    settings = replace(SETTINGS, precision=precision)
    said = feature_memory_bytes(spheres[0], settings, TINY_MODEL, tiny_network.device)
    assert said == feature_cost(spheres[0], settings, tiny_network, SPEED).peak_bytes


def test_what_rotary_positions_and_a_gated_mlp_need_is_part_of_the_memory(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer
) -> None:
    rotary = VisionTransformer(TINY_ROTARY_MODEL, random_state_dict(TINY_ROTARY_MODEL), "tiny")
    plain, needs_more = (feature_cost(spheres[0], SETTINGS, network, SPEED) for network in (tiny_network, rotary))
    buffers = 4 * 4 * TINY_MODEL.embed_dim * ROWS_AT_ONCE
    assert needs_more.peak_bytes > plain.peak_bytes + buffers


@pytest.mark.parametrize("merge_background", [True, False])
def test_calibration_finds_that_more_tokens_take_longer(tiny_network: VisionTransformer, merge_background: bool) -> None:
    speed = calibrate(tiny_network, FeatureSettings(precision="float32", merge_background=merge_background))
    assert (speed.coefficients >= 0.0).all()
    assert 0.0 < speed.seconds([100]) < speed.seconds([1000]) < speed.seconds([1000, 1000])


@pytest.mark.parametrize(("seconds_of_a_run", "runs_of_each_size"), [(0.015, 3), (0.02, 2), (5.0, 2)])
def test_calibration_does_not_keep_a_slow_computer_waiting(
    tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch, seconds_of_a_run: float, runs_of_each_size: int
) -> None:
    readings: list[float] = []

    def clock() -> float:
        # Read before and after each run.
        readings.append(len(readings) // 2 * 100.0 + len(readings) % 2 * seconds_of_a_run)
        return readings[-1]

    monkeypatch.setattr(cost_module, "time", SimpleNamespace(perf_counter=clock))
    with torch_threads(1):
        speed = calibrate(tiny_network, FeatureSettings(precision="float32"))
    assert len(readings) == 2 * runs_of_each_size * len(cost_module.CALIBRATION_ROWS) * len(cost_module.CALIBRATION_DEPTHS)
    assert (speed.coefficients >= 0.0).all()


def runs_take(monkeypatch: pytest.MonkeyPatch, seconds_of: Callable[[VisionTransformer, Sequence[PatchTokens]], float]) -> None:
    """Have each thread's clock show that each run of a network takes so long."""

    class Clock(threading.local):
        now = 0.0

    clock = Clock()

    def run(network: VisionTransformer, slices: Sequence[PatchTokens], buffers: BufferPool, between: Between) -> torch.Tensor:
        clock.now += seconds_of(network, slices)
        return torch.zeros(1)

    monkeypatch.setattr(VisionTransformer, "keys_of_tokens", run)
    monkeypatch.setattr(cost_module, "time", SimpleNamespace(perf_counter=lambda: clock.now))


@pytest.mark.parametrize("threads", [1, 3])
def test_what_is_done_once_for_a_slice_is_not_taken_for_what_every_block_does(
    monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    model = replace(TINY_MODEL, depth=6)
    runs_take(monkeypatch, lambda network, slices: len(slices) * (0.01 + 0.002 * (network.model.depth - 1)))
    with torch_threads(threads):
        speed = calibrate(VisionTransformer(model, random_state_dict(model), "tiny"), FeatureSettings(precision="float32"))
    assert speed.seconds([100]) == pytest.approx((0.01 + 5 * 0.002) / threads)


def test_every_thread_is_at_work_while_the_speed_is_measured(
    tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    all_at_work = threading.Barrier(3)

    def run(network: VisionTransformer, slices: Sequence[PatchTokens], buffers: BufferPool, between: Between) -> torch.Tensor:
        all_at_work.wait(LONGEST_WAIT_S)
        return torch.zeros(1)

    monkeypatch.setattr(VisionTransformer, "keys_of_tokens", run)
    with torch_threads(3):
        calibrate(tiny_network, FeatureSettings(precision="float32"))


def test_what_a_computer_does_for_a_moment_does_not_spoil_the_calibration(
    tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings, sizes = FeatureSettings(precision="float32"), len(cost_module.CALIBRATION_ROWS)

    def seconds_with(slow: set[int]) -> float:
        runs = itertools.count()

        def seconds_of(network: VisionTransformer, slices: Sequence[PatchTokens]) -> float:
            number = next(runs)
            return network.model.depth * (number % sizes + 1) * (0.2 if number in slow else 0.02)

        runs_take(monkeypatch, seconds_of)
        with torch_threads(1):
            return calibrate(tiny_network, settings).seconds([100, 400])

    # Two runs in a row, of different sizes: the first round, or from one round to the next.
    undisturbed = seconds_with(set())
    for first in range(2 * sizes * len(cost_module.CALIBRATION_DEPTHS) - 1):
        assert seconds_with({first, first + 1}) == pytest.approx(undisturbed)


def test_what_loads_with_the_first_slice_is_not_taken_for_every_slice(
    spheres: tuple[Volume, np.ndarray], tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    prepared: list[int] = []
    tokens = SlicePatches.tokens

    def first_takes_a_second(of_axis: SlicePatches, position: float, chosen: TokenSelection) -> PatchTokens:
        nonlocal now
        now += 0.001 if prepared else 1.0
        prepared.append(1)
        return tokens(of_axis, position, chosen)

    monkeypatch.setattr(SlicePatches, "tokens", first_takes_a_second)
    monkeypatch.setattr(cost_module, "time", SimpleNamespace(perf_counter=lambda: now))
    slices = len(ExtractionPlan(spheres[0], SETTINGS).tokens_of_slices())
    with torch_threads(1):
        seconds = feature_cost(spheres[0], SETTINGS, tiny_network, NetworkSpeed(np.zeros(3))).seconds
    assert seconds == pytest.approx(0.001 * slices)
