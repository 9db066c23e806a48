"""Features put together from keys, and interpolated to other cells."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F

from ViTTransferFunction.Logic.features.accumulation import interpolated_layers

CPU = torch.device("cpu")


@pytest.mark.parametrize("shape", [(9, 14, 10), (5, 6, 7), (5, 13, 7), (11, 6, 9)])
def test_interpolation_layer_by_layer_is_trilinear_interpolation(shape: tuple[int, int, int]) -> None:
    features = torch.randn(5, 6, 7, 3, generator=torch.Generator().manual_seed(0)).half()
    layers = torch.stack(list(interpolated_layers(iter(features), (5, 6, 7), shape)))
    expected = F.interpolate(features.float().permute(3, 0, 1, 2)[None], size=shape, mode="trilinear", align_corners=False)
    torch.testing.assert_close(layers.float(), expected[0].permute(1, 2, 3, 0), atol=2e-3, rtol=0)


def test_a_single_layer_is_repeated() -> None:
    layer = torch.randn(4, 4, 2, generator=torch.Generator().manual_seed(0)).half()
    for resized in interpolated_layers([layer], (1, 4, 4), (3, 4, 4)):
        torch.testing.assert_close(resized, layer, atol=0, rtol=0)
