"""Estimates the time and memory of an extraction before it runs; the time from a short calibration on the device.

As in an extraction, all threads of a CPU are at work, each on its own slices.

A slice of n tokens takes a + b·n + c·n² seconds: a constant, the linear layers, and attention. The three coefficients are
fitted to the times of slices of different sizes, run with one block of the network and with none. All blocks take equally long.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from ..core.system.undivided_threads import UndividedThreads
from ..core.volumes.volume import Volume
from ..weights.models import PretrainedModel
from .bounded_memory import BoundedMemory
from .expected_shapes import expected_shapes
from .extraction_plan import ExtractionPlan
from .packed_slices import PatchTokens
from .settings import FeatureSettings
from .slice_batches import tokens_at_once
from .vision_transformer import ROWS_AT_ONCE

if TYPE_CHECKING:
    import torch

    from .vision_transformer import VisionTransformer

CALIBRATION_ROWS = (12, 20, 28)
"""Calibration slices have this many rows and columns of patches: 144, 400 and 784 tokens. Real slices have some hundreds."""
CALIBRATION_TOKENS = 600
"""Tokens per calibration batch of a thread: short slices are run in batches, as in an extraction."""
CALIBRATION_DEPTHS = (1, 2)
"""Depths of the calibration networks: up to the keys of the first block, and of the second, which includes all of the first.
The difference is one block; work that is done once for a slice, such as embedding its patches, is in both."""
CALIBRATION_ROUNDS = (2, 3)
"""Least and largest number of rounds through all sizes. The first round compiles kernels. The shortest time of each size
counts, so that brief load from other programs does no harm."""
CALIBRATION_SECONDS = 0.3
"""Rounds beyond the least number must fit into this, so that calibration stays short on slow computers."""

PREPARATION_ROUNDS = 2
"""Repetitions with one slice of each axis; the shortest time counts."""

KERNELS_BYTES = 150_000_000
"""Measured (Benchmarks/results/features.json): kernels that CPU libraries compile and keep, and memory fragmentation."""

_FLOAT32 = 4


@dataclass(frozen=True)
class FeatureCost:
    """What an extraction costs.

    Attributes:
        shape: size of the feature grid in patches along the canonical axes (`ExtractionPlan`).
        tokens: number of patches that the network sees.
        seconds: duration on the calibrated device.
        peak_bytes: peak memory beyond what was in use before, including the features themselves.
    """

    shape: tuple[int, int, int]
    tokens: int
    seconds: float
    peak_bytes: int


@dataclass(frozen=True)
class NetworkSpeed:
    """Seconds for a slice of n tokens: (1, n, n²) · `coefficients`."""

    coefficients: np.ndarray

    def seconds(self, tokens_of_slices: list[int]) -> float:
        """Seconds for slices with these numbers of tokens."""
        return float((_powers(tokens_of_slices) @ self.coefficients).sum())


def calibrate(network: VisionTransformer, settings: FeatureSettings) -> NetworkSpeed:
    """Measure the speed of the network on its device, in the precision of the settings."""
    converted = network.converted(network.device, settings.dtype_on(network.device))
    short = [converted.first_blocks(depth) for depth in CALIBRATION_DEPTHS]
    without_blocks, with_one = _seconds_of_slices(short, settings.merge_background)
    seconds = without_blocks + (network.model.depth - 1) * np.maximum(with_one - without_blocks, 0.0)
    sizes = [rows * rows for rows in CALIBRATION_ROWS]
    # A fit of relative errors, so that short slices count as much as long ones.
    coefficients, _ = nnls(_powers(sizes) / seconds[:, None], np.ones(len(sizes)))
    return NetworkSpeed(coefficients)


def feature_cost(volume: Volume, settings: FeatureSettings, network: VisionTransformer, speed: NetworkSpeed) -> FeatureCost:
    """Estimate the cost of `extract_features`. Takes a fraction of a second, mostly to find the background."""
    start = time.perf_counter()
    plan = ExtractionPlan(volume, settings)
    seconds = time.perf_counter() - start
    with UndividedThreads(network.device) as threads:
        seconds += _preparation_seconds(plan, network, threads)
    tokens = plan.tokens_of_slices()
    peak = _working_bytes(plan, settings, network.model, network.device)
    return FeatureCost(plan.shape, sum(tokens), seconds + speed.seconds(tokens), peak)


def feature_memory_bytes(volume: Volume, settings: FeatureSettings, model: PretrainedModel, device: torch.device) -> int:
    """The `peak_bytes` of `feature_cost`, for which no weights are needed."""
    return _working_bytes(ExtractionPlan(volume, settings), settings, model, device)


def _preparation_seconds(plan: ExtractionPlan, network: VisionTransformer, threads: UndividedThreads) -> float:
    """Seconds to prepare the patches of all slices, extrapolated from one slice of each axis."""
    seconds = 0.0
    for axis, patches in enumerate(plan.patches(network.model.patch_size, network.device)):
        of_axis = [of_slice for of_slice in plan.slices if of_slice.axis == axis]
        tokens = partial(patches.tokens, of_axis[-1].sample.position, of_axis[-1].chosen)
        # The first matrix product on a GPU loads a library, which takes longer than all slices of a scan.
        seconds += len(of_axis) * min(_seconds(tokens, threads) for _ in range(PREPARATION_ROUNDS))
    return seconds


def _working_bytes(plan: ExtractionPlan, settings: FeatureSettings, model: PretrainedModel, device: torch.device) -> int:
    """Peak memory of an extraction, in bytes."""
    channels, pixels = model.embed_dim, 3 * model.patch_size**2
    number, tokens = settings.dtype_on(device).itemsize, plan.tokens_of_slices()
    at_once = UndividedThreads(device).count
    # Weights in single precision are in memory already.
    weights = 0 if number == _FLOAT32 else number * sum(map(math.prod, expected_shapes(model).values()))
    # Per token of a batch: its pixels in float32 and as network input; tokens, queries, keys, values, attention output.
    of_token = _FLOAT32 * pixels + number * (pixels + 5 * channels)
    hidden = number * (8 if model.gated_mlp else 4) * channels * ROWS_AT_ONCE
    if model.rotary_positions:
        # Cosines and sines; rotated queries and keys, with temporaries of twice that size.
        of_token += _FLOAT32 * channels // model.num_heads
        hidden += _FLOAT32 * 6 * channels * ROWS_AT_ONCE
    # Sums in float32, and the resulting features in float16.
    features = (_FLOAT32 + 2) * channels * math.prod(plan.shape)
    of_thread = of_token * max(tokens_at_once(tokens, device, at_once), *tokens) + hidden
    return weights + features + at_once * of_thread + KERNELS_BYTES


def _seconds_of_slices(networks: list[VisionTransformer], counted: bool) -> np.ndarray:
    """Seconds per slice of each size, (networks, sizes); `counted`: with token counts, as for merged patches."""
    batches = [_batch(rows, networks[0].model.patch_size, counted) for rows in CALIBRATION_ROWS]
    # Each has memory that is used again, as in an extraction.
    bounded, rounds = [BoundedMemory(network) for network in networks], list[list[list[float]]]()
    least, most = CALIBRATION_ROUNDS
    with UndividedThreads(networks[0].device) as threads:
        longest = CALIBRATION_SECONDS / threads.count
        while len(rounds) < least or (len(rounds) < most and np.sum(rounds) + np.sum(rounds[-1]) <= longest):
            rounds.append([[_seconds(partial(_run, network, batch), threads) for batch in batches] for network in bounded])
    seconds: np.ndarray = np.min(rounds, axis=0) / [len(batch) for batch in batches]
    return seconds


def _batch(rows: int, patch_size: int, counted: bool) -> list[PatchTokens]:
    """A batch of slices of rows × rows patches; `counted`: with token counts, as for merged patches."""
    import torch

    tokens = rows * rows
    patches = torch.ones(tokens, 3 * patch_size**2)
    chosen = (torch.arange(tokens), torch.ones(tokens)) if counted else (None, None)
    return [PatchTokens(patches, rows, rows, *chosen)] * max(1, CALIBRATION_TOKENS // tokens)


def _run(network: BoundedMemory, batch: list[PatchTokens]) -> None:
    # Devices compute asynchronously; copying the keys waits for them.
    network.keys_of_tokens(batch).cpu()


def _seconds(work: Callable[[], object], threads: UndividedThreads) -> float:
    """Seconds for each piece of work while every thread has one after the other."""

    def timed(piece: Callable[[], object]) -> float:
        start = time.perf_counter()
        piece()
        return time.perf_counter() - start

    return sum(threads.results([work] * threads.count, timed)) / threads.count**2


def _powers(tokens: list[int]) -> np.ndarray:
    return np.stack([np.ones(len(tokens)), np.array(tokens, dtype=float), np.array(tokens, dtype=float) ** 2], axis=1)
