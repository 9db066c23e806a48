"""Estimates the time and memory of an extraction before it runs; the time from a short calibration on the device.

A slice of n tokens takes a + b·n + c·n² seconds: a constant, the linear layers, and attention. The three coefficients are
fitted to the times of slices of different sizes, run with one block of the network and with none. All blocks take equally long.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from ..core.volumes.volume import Volume
from ..weights.models import PretrainedModel
from .buffer_pool import BufferPool
from .expected_shapes import expected_shapes
from .extraction_plan import TOKENS_PER_BATCH, ExtractionPlan
from .packed_slices import PatchTokens
from .settings import FeatureSettings
from .vision_transformer import ROWS_AT_ONCE

if TYPE_CHECKING:
    import torch

    from .vision_transformer import VisionTransformer

CALIBRATION_ROWS = (8, 20, 28)
"""Calibration slices have this many rows and columns of patches: 64, 400 and 784 tokens. Real slices have some hundreds."""
CALIBRATION_TOKENS = 800
"""Tokens per calibration batch: short slices are run in batches, as in an extraction."""
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
    seconds += _preparation_seconds(plan, network)
    tokens = plan.tokens_of_slices()
    peak = _working_bytes(plan, settings, network.model, network.device)
    return FeatureCost(plan.shape, sum(tokens), seconds + speed.seconds(tokens), peak)


def feature_memory_bytes(volume: Volume, settings: FeatureSettings, model: PretrainedModel, device: torch.device) -> int:
    """The `peak_bytes` of `feature_cost`, for which no weights are needed."""
    return _working_bytes(ExtractionPlan(volume, settings), settings, model, device)


def _preparation_seconds(plan: ExtractionPlan, network: VisionTransformer) -> float:
    """Seconds to prepare the patches of all slices, extrapolated from one slice of each axis."""
    patches = plan.patches(network.model.patch_size, network.device)
    slices = [sum(len(batch.samples) for batch in plan.batches if batch.axis == axis) for axis in range(3)]
    seconds = 0.0
    for axis, of_axis in enumerate(patches):
        batch = next(batch for batch in plan.batches if batch.axis == axis)
        once = []
        # The first matrix product on a GPU loads a library, which takes longer than all slices of a scan.
        for _ in range(PREPARATION_ROUNDS):
            start = time.perf_counter()
            of_axis.tokens(batch.samples[-1].position, batch.chosen[-1])
            once.append(time.perf_counter() - start)
        seconds += slices[axis] * min(once)
    return seconds


def _working_bytes(plan: ExtractionPlan, settings: FeatureSettings, model: PretrainedModel, device: torch.device) -> int:
    """Peak memory of an extraction, in bytes."""
    channels, pixels = model.embed_dim, 3 * model.patch_size**2
    number, longest = settings.dtype_on(device).itemsize, max(plan.tokens_of_slices())
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
    return weights + features + of_token * max(TOKENS_PER_BATCH, longest) + hidden + KERNELS_BYTES


def _seconds_of_slices(networks: list[VisionTransformer], counted: bool) -> np.ndarray:
    """Seconds per slice of each size, (networks, sizes); `counted`: with token counts, as for merged patches."""
    batches = [_batch(rows, networks[0].model.patch_size, counted) for rows in CALIBRATION_ROWS]
    buffers, rounds = BufferPool(), list[list[list[float]]]()
    least, most = CALIBRATION_ROUNDS
    while len(rounds) < least or (len(rounds) < most and np.sum(rounds) + np.sum(rounds[-1]) <= CALIBRATION_SECONDS):
        rounds.append([[_seconds(network, batch, buffers) for batch in batches] for network in networks])
    seconds: np.ndarray = np.min(rounds, axis=0) / [len(batch) for batch in batches]
    return seconds


def _batch(rows: int, patch_size: int, counted: bool) -> list[PatchTokens]:
    """A batch of slices of rows × rows patches; `counted`: with token counts, as for merged patches."""
    import torch

    tokens = rows * rows
    patches = torch.ones(tokens, 3 * patch_size**2)
    chosen = (torch.arange(tokens), torch.ones(tokens)) if counted else (None, None)
    return [PatchTokens(patches, rows, rows, *chosen)] * max(1, CALIBRATION_TOKENS // tokens)


def _seconds(network: VisionTransformer, batch: list[PatchTokens], buffers: BufferPool) -> float:
    """Seconds that the batch takes."""
    start = time.perf_counter()
    # Devices compute asynchronously; copying the keys waits for them.
    network.keys_of_tokens(batch, buffers).cpu()
    return time.perf_counter() - start


def _powers(tokens: list[int]) -> np.ndarray:
    return np.stack([np.ones(len(tokens)), np.array(tokens, dtype=float), np.array(tokens, dtype=float) ** 2], axis=1)
