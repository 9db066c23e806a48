"""A vision transformer that gives the attention keys of its last block: the features of the method (paper §III-A).

Dosovitskiy et al., An Image is Worth 16×16 Words, 2021; Caron et al., Emerging Properties in Self-Supervised Vision
Transformers, 2021 (DINO); Oquab et al., DINOv2, 2023; Darcet et al., Vision Transformers Need Registers, 2023.

Inference only, so there are no modules: the network is the published state dict and the functions below, and every weight
is looked up by its published name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .errors import InputError
from .pretrained_models import PretrainedModel

if TYPE_CHECKING:
    import torch
    from torch import Tensor

LAYER_NORM_EPSILON = 1e-6


@dataclass(frozen=True, eq=False)
class PatchTokens:
    """One slice as the network reads it: patches of a grid, perhaps not all of them.

    Attributes:
        patches: (T, 3·p²) pixels, channel by channel, normalised as the model expects.
        rows, columns: the slice's grid of patches.
        places: (T,) int64, row · columns + column of each patch; None where all are there, row by row.
        counts: (T,) how many alike patches each stands for, itself included; None where each stands for itself.
    """

    patches: Tensor
    rows: int
    columns: int
    places: Tensor | None = None
    counts: Tensor | None = None


class VisionTransformer:
    """A frozen ViT, ready to compute last-block keys.

    Args:
        model: the architecture.
        state_dict: the weights under their published names, any floating dtype.
        weights_digest: names the weights, for whoever keeps what is computed with them.
        device: where to compute.
        dtype: in what precision to compute; float32 unless given.

    Raises:
        InputError: the state dict is not one of this architecture (missing, unexpected or wrongly shaped entries).
    """

    def __init__(
        self,
        model: PretrainedModel,
        state_dict: dict[str, Tensor],
        weights_digest: str,
        device: torch.device | str = "cpu",
        dtype: torch.dtype | None = None,
    ) -> None:
        import torch

        _check_state_dict(model, state_dict)
        self.model = model
        self.weights_digest = weights_digest
        self.device = torch.device(device)
        self.dtype = dtype or torch.float32
        self._weights = {name: tensor.to(self.device, self.dtype) for name, tensor in state_dict.items()}
        self._position_tables: dict[tuple[int, int], Tensor] = {}

    def converted(self, device: torch.device | str, dtype: torch.dtype) -> VisionTransformer:
        """The same network on another device or in another precision; this one where both are its own."""
        import torch

        if (self.device, self.dtype) == (torch.device(device), dtype):
            return self
        return VisionTransformer(self.model, self._weights, self.weights_digest, device, dtype)

    def last_block_keys(self, images: Tensor) -> Tensor:
        """Keys `K` of the last block's self-attention, heads side by side, without class and register tokens.

        Args:
            images: (B, 3, H, W), normalised as the model expects; H and W are multiples of the patch size.

        Returns:
            (B, H / patch_size, W / patch_size, C) on the same device, in the network's precision.
        """
        size = self.model.patch_size
        rows, columns = (edge // size for edge in images.shape[-2:])
        patches = images.reshape(-1, 3, rows, size, columns, size).permute(0, 2, 4, 1, 3, 5).flatten(0, 2).flatten(1)
        return self.keys_of_tokens([PatchTokens(group, rows, columns) for group in patches.split(rows * columns)]).reshape(
            len(images), rows, columns, self.model.embed_dim
        )

    def keys_of_tokens(self, slices: Sequence[PatchTokens]) -> Tensor:
        """Last-block keys of slices of which not every patch is there; the slices do not see each other.

        All layers but attention work on the tokens of all slices in one array, so no slice is padded to the longest.

        Returns:
            (T, C), the keys of the slices' patches one after the other, on the network's device, in its precision.
        """
        import torch

        with torch.inference_mode():
            tokens = torch.cat([self._embed(group) for group in slices])
            extra = 1 + self.model.num_register_tokens
            lengths = [extra + len(group.patches) for group in slices]
            biases = [self._attention_bias(group, extra) for group in slices]
            for block in range(self.model.depth - 1):
                tokens = tokens + self._attention(tokens, lengths, biases, f"blocks.{block}")
                tokens = tokens + self._mlp(tokens, f"blocks.{block}")
            keys = self._keys(tokens, f"blocks.{self.model.depth - 1}")
            return torch.cat([of_slice[extra:] for of_slice in keys.split(lengths)])

    def _embed(self, group: PatchTokens) -> Tensor:
        """Tokens (1 + registers + patches, C): the class token, the registers, then the patches."""
        import torch
        import torch.nn.functional as F

        w = self._weights
        patches = group.patches.to(self.device, self.dtype)
        tokens = F.linear(patches, w["patch_embed.proj.weight"].flatten(1), w["patch_embed.proj.bias"])
        positions = self._position_table(group.rows, group.columns)[0]
        at_patches = positions[1:] if group.places is None else positions[1:][group.places.to(self.device)]
        # Registers carry no position (Darcet et al. 2023).
        registers = [w["register_tokens"][0]] if self.model.num_register_tokens else []
        return torch.cat([w["cls_token"][0] + positions[:1], *registers, tokens + at_patches])

    def _attention_bias(self, group: PatchTokens, extra: int) -> Tensor | None:
        """What is added to every token's logits, (1, extra + patches): a token that stands for n counts n times.

        log n on the logit of a key is what n equal keys side by side amount to (Bolya et al., Token Merging, 2023, Eq. 1).
        """
        import torch

        if group.counts is None:
            return None
        return torch.cat([torch.zeros(extra), group.counts.float().log()])[None].to(self.device, self.dtype)

    def _position_table(self, rows: int, columns: int) -> Tensor:
        """Position embeddings (1, 1 + rows·columns, C), remembered because every slice of an axis asks for the same."""
        if (rows, columns) not in self._position_tables:
            table = interpolate_position_table(self._weights["pos_embed"].float(), rows, columns)
            self._position_tables[rows, columns] = table.to(self.dtype)
        return self._position_tables[rows, columns]

    def _attention(self, tokens: Tensor, lengths: list[int], biases: Sequence[Tensor | None], block: str) -> Tensor:
        """Self-attention within each slice of packed tokens (T, C), whose numbers of tokens are `lengths`."""
        import torch
        import torch.nn.functional as F

        w = self._weights
        heads, channels = self.model.num_heads, tokens.shape[1]
        normed = self._layer_norm(tokens, f"{block}.norm1")
        qkv = F.linear(normed, w[f"{block}.attn.qkv.weight"], w[f"{block}.attn.qkv.bias"])
        attended = torch.empty_like(tokens)
        for of_slice, out, bias in zip(qkv.split(lengths), attended.split(lengths), biases, strict=True):
            query, key, value = of_slice.reshape(1, -1, 3, heads, channels // heads).permute(2, 0, 3, 1, 4)
            mask = None if bias is None else bias.expand(1, 1, len(out), -1)
            of_heads = F.scaled_dot_product_attention(query, key, value, attn_mask=mask)
            out.copy_(of_heads[0].transpose(0, 1).flatten(1))
        projected = F.linear(attended, w[f"{block}.attn.proj.weight"], w[f"{block}.attn.proj.bias"])
        return self._layer_scale(projected, f"{block}.ls1")

    def _mlp(self, tokens: Tensor, block: str) -> Tensor:
        import torch.nn.functional as F

        w = self._weights
        hidden = F.linear(self._layer_norm(tokens, f"{block}.norm2"), w[f"{block}.mlp.fc1.weight"], w[f"{block}.mlp.fc1.bias"])
        output = F.linear(F.gelu(hidden), w[f"{block}.mlp.fc2.weight"], w[f"{block}.mlp.fc2.bias"])
        return self._layer_scale(output, f"{block}.ls2")

    def _keys(self, tokens: Tensor, block: str) -> Tensor:
        """Only the key third of the block's qkv projection: nothing after it is ever read."""
        import torch.nn.functional as F

        channels = self.model.embed_dim
        weight = self._weights[f"{block}.attn.qkv.weight"][channels : 2 * channels]
        bias = self._weights[f"{block}.attn.qkv.bias"][channels : 2 * channels]
        return F.linear(self._layer_norm(tokens, f"{block}.norm1"), weight, bias)

    def _layer_norm(self, tokens: Tensor, name: str) -> Tensor:
        import torch.nn.functional as F

        w = self._weights
        return F.layer_norm(tokens, tokens.shape[-1:], w[f"{name}.weight"], w[f"{name}.bias"], LAYER_NORM_EPSILON)

    def _layer_scale(self, tokens: Tensor, name: str) -> Tensor:
        return tokens * self._weights[f"{name}.gamma"] if self.model.layer_scale else tokens


def interpolate_position_table(table: Tensor, rows: int, columns: int) -> Tensor:
    """Resize a learned position table to another patch grid, bicubic with anti-aliasing; the class entry is kept.

    Args:
        table: (1, 1 + n², C), the class token's entry first.
        rows, columns: patch grid to resize to.

    Returns:
        (1, 1 + rows·columns, C); `table` itself where the grid is n × n already.
    """
    import torch
    import torch.nn.functional as F

    side = math.isqrt(table.shape[1] - 1)
    if (rows, columns) == (side, side):
        return table
    grid = table[:, 1:].reshape(1, side, side, -1).permute(0, 3, 1, 2)
    grid = F.interpolate(grid, size=(rows, columns), mode="bicubic", antialias=True, align_corners=False)
    return torch.cat([table[:, :1], grid.flatten(2).transpose(1, 2)], dim=1)


def expected_shapes(model: PretrainedModel) -> dict[str, tuple[int, ...]]:
    """Name and shape of every entry of the architecture's published state dict."""
    c, p = model.embed_dim, model.patch_size
    shapes: dict[str, tuple[int, ...]] = {
        "cls_token": (1, 1, c),
        "pos_embed": (1, 1 + model.position_grid**2, c),
        "patch_embed.proj.weight": (c, 3, p, p),
        "patch_embed.proj.bias": (c,),
        "norm.weight": (c,),
        "norm.bias": (c,),
    }
    if model.num_register_tokens:
        shapes["register_tokens"] = (1, model.num_register_tokens, c)
    for block in (f"blocks.{index}" for index in range(model.depth)):
        for name, rows, columns in (("attn.qkv", 3 * c, c), ("attn.proj", c, c), ("mlp.fc1", 4 * c, c), ("mlp.fc2", c, 4 * c)):
            shapes[f"{block}.{name}.weight"] = (rows, columns)
            shapes[f"{block}.{name}.bias"] = (rows,)
        for norm in ("norm1", "norm2"):
            shapes[f"{block}.{norm}.weight"] = shapes[f"{block}.{norm}.bias"] = (c,)
        if model.layer_scale:
            shapes[f"{block}.ls1.gamma"] = shapes[f"{block}.ls2.gamma"] = (c,)
    return shapes


def _check_state_dict(model: PretrainedModel, state_dict: dict[str, Tensor]) -> None:
    expected = expected_shapes(model)
    got = {name: tuple(tensor.shape) for name, tensor in state_dict.items()}
    differing = sorted(name for name in expected.keys() | got.keys() if expected.get(name) != got.get(name))
    if differing:
        first = differing[0]
        raise InputError(
            f"The weights are not those of '{model.name}': {len(differing)} entries differ, first '{first}': expected "
            f"{expected.get(first, 'no such entry')}, got {got.get(first, 'no such entry')}. "
            "Name the model that the file belongs to with --model, or choose another file."
        )
