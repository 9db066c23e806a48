"""A volume of five balls, and features of it as if they had been extracted: what counts here is how many there are."""

from __future__ import annotations

import numpy as np

from Benchmarks.interaction.update_cost import CHANNELS
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction_plan import ExtractionPlan
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.settings import feature_key, grid_shape
from ViTTransferFunction.Logic.features.whitening import normalised_features
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.weights.models import pretrained_model

CELLS = PRESETS[DEFAULT_PRESET].features.grid
"""Along the longest edge."""

Shape = tuple[int, int, int]


def phantom(shape: Shape) -> Volume:
    """Balls of different brightness in noise, (K, J, I) int16 at 1 mm."""
    rng = np.random.default_rng(0)
    array = rng.normal(0.0, 10.0, shape).astype(np.int16)
    k, j, i = (np.arange(count) for count in shape)
    radius = min(shape) / 8
    for value, centre in zip((100, 200, 300, 400, 500), centres(shape), strict=True):
        box = tuple(slice(int(c - radius), int(c + radius) + 2) for c in centre)
        squared = sum(
            (positions[extent].reshape(place) - c) ** 2
            for positions, extent, place, c in zip((k, j, i), box, ((-1, 1, 1), (-1, 1), (-1,)), centre, strict=True)
        )
        array[box][squared < radius**2] += value
    return Volume(array, Geometry(shape, np.eye(4)), "phantom")


def centres(shape: Shape) -> np.ndarray:
    """Of the five balls, (5, 3), voxels along (k, j, i)."""
    shares = np.array([[0.3, 0.3, 0.3], [0.7, 0.3, 0.3], [0.3, 0.7, 0.3], [0.3, 0.3, 0.7], [0.7, 0.7, 0.7]])
    return shares * shape


def cache_features(volume: Volume) -> None:
    """Features in which each ball has a direction of its own, as if they had been extracted."""
    rng = np.random.default_rng(1)
    settings = PRESETS[DEFAULT_PRESET].features
    patches = ExtractionPlan(volume, settings).patches_geometry
    middles = [
        ((np.arange(count) + 0.5) * voxels / count).astype(int)
        for count, voxels in zip(patches.shape, volume.shape, strict=True)
    ]
    brightness = volume.array[np.ix_(*middles)]
    directions = rng.normal(0.0, 1.0, (6, CHANNELS)).astype(np.float16)
    array = directions[np.clip(np.rint(brightness / 100), 0, 5).astype(int)]
    array += 0.5 * rng.standard_normal(array.shape, dtype=np.float32).astype(np.float16)
    model = pretrained_model(PRESETS[DEFAULT_PRESET].model)
    key = feature_key(volume, model.name, model.sha256 or "", settings, choose_device("auto"))
    cells = volume.geometry.resized(grid_shape(volume.geometry, settings))
    features = FeatureVolume(array, patches, key, cells)
    FeatureCache().put(normalised_features(features, PRESETS[DEFAULT_PRESET].statistics).source)
