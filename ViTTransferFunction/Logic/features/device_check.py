"""Whether a device computes the features that the processor does.

What PyTorch can do on a graphics processor, and what comes out, depends on the system and the driver: whole releases of macOS
have computed something else on Apple's, without a word. All that follows rests on the features, so a device is tried before it
is relied on.
"""

from __future__ import annotations

import numpy as np

from ..core.system.out_of_memory import is_out_of_memory
from ..core.volumes.geometry import Geometry
from ..core.volumes.volume import Volume
from .extraction import extract_features
from .settings import FeatureSettings
from .vision_transformer import VisionTransformer

MAX_RELATIVE_ERROR = 0.1
"""Of the features' differences from their mean, all cells together. Half precision makes a hundredth; what is wrong makes 1."""


class UnsoundDevice(RuntimeError):
    """A device does not compute what the processor does, or cannot (`device_trouble`)."""


def device_trouble(network: VisionTransformer) -> str:
    """What is wrong with a network's device; "" where it computes the features of a made-up volume as the processor does.

    Raises:
        RuntimeError, MemoryError: memory runs out (`is_out_of_memory`).
    """
    import torch

    volume = _made_up_volume()
    try:
        on_device = extract_features(volume, network, FeatureSettings(_GRID)).array.astype(np.float32)
    except RuntimeError as error:
        if is_out_of_memory(error):
            raise
        return f"{network.device} fails: {error}"
    processor = network.converted("cpu", torch.float32)
    expected = extract_features(volume, processor, FeatureSettings(_GRID, precision="float32")).array.astype(np.float32)
    spread = np.linalg.norm(expected - expected.mean(axis=(0, 1, 2)))
    relative_error = np.linalg.norm(on_device - expected) / spread
    # What is not a number is no small one either.
    if relative_error <= MAX_RELATIVE_ERROR:
        return ""
    return f"features on {network.device} differ from the processor's by {relative_error:.2g} of their spread"


_GRID = 32


def _made_up_volume() -> Volume:
    """A thin slab of blots in noise, beside air: a large slice, many small ones, and patches that stand for several."""
    j, i = np.mgrid[:96, :96] / 96.0
    blots = np.sin(9.0 * i) * np.cos(7.0 * j * i) + np.random.default_rng(0).normal(0.0, 0.2, (4, 96, 96))
    return Volume(np.where(i > 0.3, 1000.0 + 300.0 * blots, 0.0).astype(np.float32), Geometry((4, 96, 96), np.eye(4)))
