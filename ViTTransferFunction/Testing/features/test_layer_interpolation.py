"""Vectors interpolated to other cells."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from ViTTransferFunction.Logic.features.layer_interpolation import interpolated_layers


@pytest.mark.parametrize("shape", [(9, 14, 10), (5, 6, 7), (5, 13, 7), (11, 6, 9)])
def test_interpolation_layer_by_layer_is_trilinear_interpolation(shape: tuple[int, int, int]) -> None:
    features = torch.randn(5, 3, 6, 7, generator=torch.Generator().manual_seed(0))
    layers = np.stack(list(interpolated_layers(features.numpy(), (5, 6, 7), shape)), axis=1)
    expected = F.interpolate(features.movedim(1, 0)[None], size=shape, mode="trilinear", align_corners=False)
    np.testing.assert_allclose(layers, expected[0].numpy(), atol=1e-5)


def test_a_single_layer_is_repeated() -> None:
    layer = np.random.default_rng(0).random((2, 4, 4), np.float32)
    for resized in interpolated_layers([layer], (1, 4, 4), (3, 4, 4)):
        np.testing.assert_array_equal(resized, layer)
