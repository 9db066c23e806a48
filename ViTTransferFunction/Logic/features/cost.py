"""What an extraction will cost, before it runs: seconds and memory, from some tenths of a second of calibration on the device.

A slice of n tokens takes a + b·n + c·n² seconds: what is done for each slice, the linear layers, and attention. The three are
fitted to slices of different sizes, run through one block of the network and through none: all blocks take as long as that one.
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
"""Slices of as many rows and columns of patches: 64, 400 and 784 tokens, of which a slice has some hundreds."""
CALIBRATION_TOKENS = 800
"""Short slices are run several at once, as they will be."""
CALIBRATION_DEPTHS = (1, 2)
"""The keys of the first block; and those of the second, with all of the first before them. What is done once for a slice, such
as making tokens of its patches, is in both."""
CALIBRATION_ROUNDS = (2, 3)
"""Through all sizes, at least and at most. The first compiles kernels; of each size the shortest counts, so that what else the
computer does for a moment spoils none."""
CALIBRATION_SECONDS = 0.3
"""More rounds than the least, only as far as they fit into this: a slow computer does not keep its user waiting."""

PREPARATION_ROUNDS = 2
"""Of one slice of each axis; the shorter counts."""

KERNELS_BYTES = 150_000_000
"""Measured (Benchmarks/results/features.json): kernels that a processor's libraries compile and keep, and gaps in memory."""

_FLOAT32 = 4


@dataclass(frozen=True)
class FeatureCost:
    """What an extraction costs.

    Attributes:
        shape: patches that the features have along the canonical axes (`ExtractionPlan`).
        tokens: patches that the network sees.
        seconds: on the device that was calibrated.
        peak_bytes: memory in use at the most, beyond what was in use before; the features themselves included.
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
    """Measure the network on its device, in the precision of the settings."""
    converted = network.converted(network.device, settings.dtype_on(network.device))
    short = [converted.first_blocks(depth) for depth in CALIBRATION_DEPTHS]
    without_blocks, with_one = _seconds_of_slices(short, settings.merge_background)
    seconds = without_blocks + (network.model.depth - 1) * np.maximum(with_one - without_blocks, 0.0)
    sizes = [rows * rows for rows in CALIBRATION_ROWS]
    # Relative errors count: the shortest slice is as good a witness as the longest.
    coefficients, _ = nnls(_powers(sizes) / seconds[:, None], np.ones(len(sizes)))
    return NetworkSpeed(coefficients)


def feature_cost(volume: Volume, settings: FeatureSettings, network: VisionTransformer, speed: NetworkSpeed) -> FeatureCost:
    """Estimate what `extract_features` will take; a fraction of a second, of which most is finding the background."""
    start = time.perf_counter()
    plan = ExtractionPlan(volume, settings)
    seconds = time.perf_counter() - start
    seconds += _preparation_seconds(plan, network)
    tokens = plan.tokens_of_slices()
    peak = _working_bytes(plan, settings, network.model, network.device)
    return FeatureCost(plan.shape, sum(tokens), seconds + speed.seconds(tokens), peak)


def feature_memory_bytes(volume: Volume, settings: FeatureSettings, model: PretrainedModel, device: torch.device) -> int:
    """The `peak_bytes` of `feature_cost`, which can be told without the weights."""
    return _working_bytes(ExtractionPlan(volume, settings), settings, model, device)


def _preparation_seconds(plan: ExtractionPlan, network: VisionTransformer) -> float:
    """Seconds in which all slices become patches, from one slice of each axis."""
    patches = plan.patches(network.model.patch_size, network.device)
    slices = [sum(len(batch.samples) for batch in plan.batches if batch.axis == axis) for axis in range(3)]
    seconds = 0.0
    for axis, of_axis in enumerate(patches):
        batch = next(batch for batch in plan.batches if batch.axis == axis)
        once = []
        # The first product on a graphics card loads a library, which takes longer than all the slices of a scan.
        for _ in range(PREPARATION_ROUNDS):
            start = time.perf_counter()
            of_axis.tokens(batch.samples[-1].position, batch.chosen[-1])
            once.append(time.perf_counter() - start)
        seconds += slices[axis] * min(once)
    return seconds


def _working_bytes(plan: ExtractionPlan, settings: FeatureSettings, model: PretrainedModel, device: torch.device) -> int:
    """What is held while slices are run."""
    channels, pixels = model.embed_dim, 3 * model.patch_size**2
    number, longest = settings.dtype_on(device).itemsize, max(plan.tokens_of_slices())
    # Those in single precision are there already.
    weights = 0 if number == _FLOAT32 else number * sum(map(math.prod, expected_shapes(model).values()))
    # Of a batch: its pixels as they come and as the network takes them; tokens, queries, keys, values, what attention gives.
    of_token = _FLOAT32 * pixels + number * (pixels + 5 * channels)
    hidden = number * (8 if model.gated_mlp else 4) * channels * ROWS_AT_ONCE
    if model.rotary_positions:
        # Cosines and sines; queries and keys as they are turned, and twice what that takes.
        of_token += _FLOAT32 * channels // model.num_heads
        hidden += _FLOAT32 * 6 * channels * ROWS_AT_ONCE
    # Sums in float32, and the features in float16 that they become.
    features = (_FLOAT32 + 2) * channels * math.prod(plan.shape)
    return weights + features + of_token * max(TOKENS_PER_BATCH, longest) + hidden + KERNELS_BYTES


def _seconds_of_slices(networks: list[VisionTransformer], counted: bool) -> np.ndarray:
    """Seconds for one slice of each size, in a batch, (networks, sizes); `counted` as where patches stand for others."""
    batches = [_batch(rows, networks[0].model.patch_size, counted) for rows in CALIBRATION_ROWS]
    buffers, rounds = BufferPool(), list[list[list[float]]]()
    least, most = CALIBRATION_ROUNDS
    while len(rounds) < least or (len(rounds) < most and np.sum(rounds) + np.sum(rounds[-1]) <= CALIBRATION_SECONDS):
        rounds.append([[_seconds(network, batch, buffers) for batch in batches] for network in networks])
    seconds: np.ndarray = np.min(rounds, axis=0) / [len(batch) for batch in batches]
    return seconds


def _batch(rows: int, patch_size: int, counted: bool) -> list[PatchTokens]:
    """Slices of rows × rows patches that are run at once."""
    import torch

    tokens = rows * rows
    patches = torch.ones(tokens, 3 * patch_size**2)
    chosen = (torch.arange(tokens), torch.ones(tokens)) if counted else (None, None)
    return [PatchTokens(patches, rows, rows, *chosen)] * max(1, CALIBRATION_TOKENS // tokens)


def _seconds(network: VisionTransformer, batch: list[PatchTokens], buffers: BufferPool) -> float:
    """What the batch takes."""
    start = time.perf_counter()
    # Copying the keys waits for a device that works on while the program goes on.
    network.keys_of_tokens(batch, buffers).cpu()
    return time.perf_counter() - start


def _powers(tokens: list[int]) -> np.ndarray:
    return np.stack([np.ones(len(tokens)), np.array(tokens, dtype=float), np.array(tokens, dtype=float) ** 2], axis=1)
