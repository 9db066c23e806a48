"""Where the air around a body is, which baselines are not asked about: it is background."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.background_tokens import background_cells
from ViTTransferFunction.Logic.features.settings import FeatureSettings, grid_shape


def body_mask(volume: Volume) -> np.ndarray:
    """(K, J, I) bool: all but the cells that hold only the air around the body, as feature extraction finds them."""
    settings = FeatureSettings()
    air = background_cells(volume.array, settings.channels_for(volume).background, grid_shape(volume.geometry, settings))
    nearest = [np.arange(voxels) * cells // voxels for cells, voxels in zip(air.shape, volume.shape, strict=True)]
    return ~air[np.ix_(*nearest)]
