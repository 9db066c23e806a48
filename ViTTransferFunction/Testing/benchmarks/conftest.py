"""What several tests of the benchmarks are given."""

from __future__ import annotations

import numpy as np
import pytest

from Benchmarks.shared.labelled_cases import LabelledVolume
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Testing.support.spheres import Spheres


@pytest.fixture
def labelled(spheres: Spheres) -> LabelledVolume:
    """The three spheres as a benchmark's case."""
    return LabelledVolume(*spheres, ("left", "right", "dark"))


@pytest.fixture
def features(labelled: LabelledVolume) -> FeatureVolume:
    """What share of each cell of 2×4×4 voxels each label has, with some noise."""
    one_hot = np.stack([labelled.truth == label for label in range(4)], axis=-1).astype(np.float32)
    array = one_hot.reshape(16, 2, 10, 4, 12, 4, 4).mean(axis=(1, 3, 5))
    array += np.random.default_rng(0).normal(0.0, 0.01, array.shape)
    return FeatureVolume(array.astype(np.float16), labelled.volume.geometry.resized(array.shape[:3]), "known")
