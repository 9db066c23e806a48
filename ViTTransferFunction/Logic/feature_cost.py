"""What an extraction will cost, before it runs: seconds and memory, from a second of calibration on the device.

A slice of n tokens takes a + b·n + c·n² seconds: what is done for each slice, the linear layers, and attention. The three are
fitted to slices of different sizes, run through the network itself.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from .extraction_plan import TOKENS_PER_BATCH, ExtractionPlan
from .feature_extraction import features_size_bytes
from .feature_settings import FeatureSettings
from .pretrained_models import PretrainedModel
from .volume import Volume

if TYPE_CHECKING:
    from .vision_transformer import VisionTransformer

CALIBRATION_ROWS = (8, 20, 36)
"""Slices of as many rows and columns of patches: 64, 400 and 1296 tokens, a second in all on two cores."""
CALIBRATION_TOKENS = 1296
"""Short slices are run several at once, as they will be."""

UNUSED_BYTES_PER_TOKEN = 3500
"""Measured (Benchmarks/results/features.json): batches that differ in size leave gaps between what is allocated."""

_FLOAT16, _FLOAT32 = 2, 4


@dataclass(frozen=True)
class FeatureCost:
    """What an extraction costs.

    Attributes:
        tokens: patches that the network sees.
        seconds: on the device that was calibrated.
        peak_bytes: memory in use at the most, the features themselves and the weights included.
    """

    tokens: int
    seconds: float
    peak_bytes: int


@dataclass(frozen=True)
class NetworkSpeed:
    """Seconds for a slice of n tokens: (1, n, n²) · `coefficients`."""

    coefficients: np.ndarray

    def seconds(self, tokens_of_slices: list[int]) -> float:
        """Seconds for slices of so many tokens."""
        return float((_powers(tokens_of_slices) @ self.coefficients).sum())


def calibrate(network: VisionTransformer, settings: FeatureSettings) -> NetworkSpeed:
    """Measure the network on its device, in the precision of the settings."""
    converted = network.converted(network.device, settings.precision_on(network.device))
    sizes = [rows * rows for rows in CALIBRATION_ROWS]
    seconds = np.array([_seconds_for_one(converted, rows) for rows in CALIBRATION_ROWS])
    # Relative errors count: the shortest slice is as good a witness as the longest.
    coefficients, _ = nnls(_powers(sizes) / seconds[:, None], np.ones(len(sizes)))
    return NetworkSpeed(coefficients)


def feature_cost(volume: Volume, settings: FeatureSettings, network: VisionTransformer, speed: NetworkSpeed) -> FeatureCost:
    """Estimate what `extract_features` will take; a fraction of a second, of which most is finding the air."""
    start = time.perf_counter()
    plan = ExtractionPlan(volume, settings)
    seconds = time.perf_counter() - start + _preparation_seconds(plan, network)
    tokens = plan.tokens_of_slices()
    peak = _peak_bytes(plan, max(tokens), network.model, features_size_bytes(volume.geometry, settings, network.model))
    if settings.thin_air:
        peak += UNUSED_BYTES_PER_TOKEN * sum(tokens)
    return FeatureCost(sum(tokens), seconds + speed.seconds(tokens), peak)


def _preparation_seconds(plan: ExtractionPlan, network: VisionTransformer) -> float:
    """Seconds in which all slices become patches, from one slice of each axis."""
    patches = plan.patches(network.model.patch_size, network.device)
    slices = [sum(len(batch.samples) for batch in plan.batches if batch.axis == axis) for axis in range(3)]
    seconds = 0.0
    for axis, of_axis in enumerate(patches):
        batch = next(batch for batch in plan.batches if batch.axis == axis)
        start = time.perf_counter()
        of_axis.tokens(batch.samples[-1].position, batch.chosen[-1])
        seconds += slices[axis] * (time.perf_counter() - start)
    return seconds


def _peak_bytes(plan: ExtractionPlan, longest: int, model: PretrainedModel, result: int) -> int:
    """Weights, and the most of what is held while slices are run and while features are put together."""
    channels = model.embed_dim
    cells = math.prod(plan.shape)
    weights = 2 * _FLOAT32 * 12 * model.depth * channels**2
    # Of a batch: its pixels, and a block's tokens, their norm, and the hidden layer before and after its activation.
    of_token = 2 * 3 * model.patch_size**2 + (1 + 1 + 4 + 4) * channels
    running = _FLOAT32 * of_token * max(TOKENS_PER_BATCH, longest)
    sums, averaged = _FLOAT32 * channels * cells, _FLOAT16 * channels * cells
    return weights + sums + max(running, averaged + 2 * result)


def _seconds_for_one(network: VisionTransformer, rows: int) -> float:
    """Seconds for one slice of rows × rows patches, in a batch."""
    import torch

    edge = rows * network.model.patch_size
    images = torch.ones(max(1, CALIBRATION_TOKENS // rows**2), 3, edge, edge)
    least = float("inf")
    for _ in range(2):
        start = time.perf_counter()
        # Copying the keys waits for a device that works on while the program goes on.
        network.last_block_keys(images).cpu()
        least = min(least, time.perf_counter() - start)
    return least / len(images)


def _powers(tokens: list[int]) -> np.ndarray:
    return np.stack([np.ones(len(tokens)), np.array(tokens, dtype=float), np.array(tokens, dtype=float) ** 2], axis=1)
