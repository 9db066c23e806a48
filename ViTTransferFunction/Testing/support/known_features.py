"""Features with a known answer, put into the cache: sessions find them there and need no network."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.settings import feature_key, grid_shape
from ViTTransferFunction.Logic.session.close_ups import close_up_settings
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.weights.models import pretrained_model

GRID = 16
SETTINGS = PRESETS[DEFAULT_PRESET].features.with_grid(GRID)
"""The settings that the features are cached under, those of the default preset but for the grid."""


def cache_known_features(volume: Volume, labels: np.ndarray) -> None:
    """Put features of the spheres of conftest into the cache: the share of each label in a cell."""
    geometry = volume.geometry.resized((16, 13, 16))
    one_hot = np.stack([labels == label for label in range(4)], axis=-1).astype(np.float32)
    array = one_hot.reshape(16, 2, 40, 16, 3, 4).mean(axis=(1, 4))
    rows = np.round(np.linspace(0, 39, 13)).astype(int)
    array = array[:, rows] + np.random.default_rng(0).normal(0.0, 0.01, (16, 13, 16, 4))
    model = pretrained_model(PRESETS[DEFAULT_PRESET].model)
    key = feature_key(volume, model.name, model.sha256 or "", SETTINGS, choose_device("auto"))
    FeatureCache().put(FeatureVolume(array.astype(np.float16), geometry, key))


def cache_known_close_up(volume: Volume, labels: np.ndarray, close_up: CloseUp, points_ras: np.ndarray) -> None:
    """Put features of a close-up of the spheres into the cache: which label is at a cell's centre.

    Args:
        volume: the spheres of conftest.
        labels: their labels.
        close_up: what is looked at.
        points_ras: the class's positive points, (N, 3).
    """
    part = volume.part(close_up.box_in(volume.geometry, points_ras))
    settings = close_up_settings(SETTINGS, part.geometry)
    geometry = part.geometry.resized(grid_shape(part.geometry, settings))
    k, j, i = np.round(volume.geometry.ras_to_ijk(geometry.voxel_centres_ras()))[:, ::-1].astype(int).T
    one_hot = np.eye(4)[labels[k, j, i]].reshape(*geometry.shape, 4)
    array = one_hot + np.random.default_rng(0).normal(0.0, 0.01, one_hot.shape)
    model = pretrained_model(PRESETS[DEFAULT_PRESET].model)
    key = feature_key(part, model.name, model.sha256 or "", settings, choose_device("auto"))
    FeatureCache().put(FeatureVolume(array.astype(np.float16), geometry, key))
