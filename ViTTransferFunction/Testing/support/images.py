"""Whole images through a network, as independent implementations take them."""

from __future__ import annotations

from torch import Tensor

from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer


def last_block_keys(network: VisionTransformer, images: Tensor) -> Tensor:
    """Keys (B, H / patch_size, W / patch_size, C) of images (B, 3, H, W), normalised as the model expects."""
    size = network.model.patch_size
    rows, columns = (edge // size for edge in images.shape[-2:])
    patches = images.reshape(-1, 3, rows, size, columns, size).permute(0, 2, 4, 1, 3, 5).flatten(0, 2).flatten(1)
    keys = network.keys_of_tokens([PatchTokens(group, rows, columns) for group in patches.split(rows * columns)])
    return keys.reshape(len(images), rows, columns, network.model.embed_dim)
