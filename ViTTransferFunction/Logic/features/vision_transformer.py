"""A vision transformer that gives the attention keys of its last block: the features of the method (paper §III-A).

Dosovitskiy et al., An Image is Worth 16×16 Words, 2021; Caron et al., Emerging Properties in Self-Supervised Vision
Transformers, 2021 (DINO); Oquab et al., DINOv2, 2023; Darcet et al., Vision Transformers Need Registers, 2023; Siméoni et al.,
DINOv3, 2025.

Inference only, so there are no modules: the network is the published state dict and the functions below, and every weight
is looked up by its published name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..weights.models import PretrainedModel
from .buffer_pool import BufferPool
from .expected_shapes import check_state_dict, expected_shapes, register_name
from .packed_slices import PackedSlices, PatchTokens
from .position_table import PositionTable
from .rotary_positions import RotaryPositions, rotate

if TYPE_CHECKING:
    import torch
    from torch import Tensor

ROWS_AT_ONCE = 2048
"""Rows that go through a layer at once on a processor: what lies between two layers then stays in its cache."""


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

        check_state_dict(model, state_dict)
        self.model = model
        self.weights_digest = weights_digest
        self.device = torch.device(device)
        self.dtype = dtype or torch.float32
        self._weights = {name: tensor.to(self.device, self.dtype) for name, tensor in _masked(state_dict).items()}
        self._table = None if model.rotary_positions else PositionTable(self._weights["pos_embed"], self.dtype)
        periods = state_dict.get("rope_embed.periods")
        # As float32 first: Apple's graphics processors have no bfloat16 before macOS 14.
        self._rotary = None if periods is None else RotaryPositions(periods.float().to(self.device))

    def converted(self, device: torch.device | str, dtype: torch.dtype) -> VisionTransformer:
        """The same network on another device or in another precision; this one where both are its own."""
        import torch

        if (self.device, self.dtype) == (torch.device(device), dtype):
            return self
        return VisionTransformer(self.model, self._weights, self.weights_digest, device, dtype)

    def first_blocks(self, depth: int) -> VisionTransformer:
        """The network of the first `depth` blocks alone: not for features, but to tell how fast a block is."""
        model = replace(self.model, depth=depth)
        weights = {name: self._weights[name] for name in expected_shapes(model)}
        return VisionTransformer(model, weights, self.weights_digest, self.device, self.dtype)

    def keys_of_tokens(self, slices: Sequence[PatchTokens], buffers: BufferPool | None = None) -> Tensor:
        """Keys `K` of the last block's self-attention, heads side by side, without class and register tokens.

        Not every patch of a slice need be there; the slices do not see each other.

        Args:
            slices: to run at once.
            buffers: for whoever runs many batches one after the other.

        Returns:
            (T, C), the keys of the slices' patches one after the other, on the network's device, in its precision.
        """
        import torch

        with torch.inference_mode():
            packed = PackedSlices(slices, 1 + self.model.num_register_tokens)
            work = buffers or BufferPool()
            tokens = self._embed(slices, packed, work)
            biases = [self._attention_bias(group, span) for group, span in zip(slices, packed.spans, strict=True)]
            rotations = () if self._rotary is None else self._rotary.rotations(slices, packed, work)
            for block in range(self.model.depth - 1):
                self._add_attention(tokens, packed.spans, biases, rotations, f"blocks.{block}", work)
                self._add_mlp(tokens, f"blocks.{block}", work)
            keys = self._keys(tokens, f"blocks.{self.model.depth - 1}")
            return torch.cat([keys[patches] for patches in packed.patches])

    def _embed(self, slices: Sequence[PatchTokens], packed: PackedSlices, work: BufferPool) -> Tensor:
        """Tokens (R, C): of each slice the class token, the registers, then the patches; zeros where there are none."""
        w = self._weights
        weight = w["patch_embed.proj.weight"].flatten(1)
        pixels = self._rows(work, "pixels", packed.rows, weight.shape[1]).zero_()
        tokens = self._rows(work, "tokens", packed.rows, weight.shape[0]).zero_()
        for group, span, patches in zip(slices, packed.spans, packed.patches, strict=True):
            tokens[span.start] = w["cls_token"][0, 0]
            if self.model.num_register_tokens:
                # Registers carry no position (Darcet et al. 2023).
                tokens[span.start + 1 : patches.start] = w[register_name(self.model)][0]
            tokens[patches] = w["patch_embed.proj.bias"]
            if self._table is not None:
                positions = self._table.resized(group.rows, group.columns)
                tokens[span.start] += positions[0]
                tokens[patches] += positions[1:] if group.places is None else positions[1:][group.places.to(self.device)]
            pixels[patches] = group.patches.to(self.device)
        return tokens.addmm_(pixels, weight.T)

    def _attention_bias(self, group: PatchTokens, span: slice) -> Tensor | None:
        """What is added to every token's logits, (1, rows of the slice): a token that stands for n counts n times.

        log n on the logit of a key is what n equal keys side by side amount to (Bolya et al., Token Merging, 2023, Eq. 1):
        also for padding, which counts for nothing.
        """
        import torch

        if group.multiplicity is None:
            return None
        prefix = 1 + self.model.num_register_tokens
        multiplicity = torch.zeros(span.stop - span.start)
        multiplicity[:prefix] = 1.0
        multiplicity[prefix : prefix + len(group.multiplicity)] = group.multiplicity
        return multiplicity.log()[None].to(self.device, self.dtype)

    def _add_attention(
        self,
        tokens: Tensor,
        spans: Sequence[slice],
        biases: Sequence[Tensor | None],
        rotations: tuple[Tensor, ...],
        block: str,
        work: BufferPool,
    ) -> None:
        """Add self-attention within each slice, whose rows of the tokens (R, C) are `spans`.

        `rotations` are the cosines and sines by which queries and keys are turned; none without rotary positions.
        """
        import torch.nn.functional as F

        heads, (rows, channels) = self.model.num_heads, tokens.shape
        qkv = self._rows(work, "qkv", rows, 3 * channels)
        for part, out, *rotation in self._parts(tokens, qkv, *rotations):
            self._linear(self._layer_norm(part, f"{block}.norm1"), f"{block}.attn.qkv", out)
            if rotation:
                rotate(out[:, : 2 * channels], *rotation)
        attended = self._rows(work, "attended", rows, channels)
        attended[spans[-1].stop :] = 0.0
        for span, bias in zip(spans, biases, strict=True):
            query, key, value = qkv[span].reshape(1, -1, 3, heads, channels // heads).permute(2, 0, 3, 1, 4)
            mask = None if bias is None else bias.expand(1, 1, query.shape[2], -1)
            of_heads = F.scaled_dot_product_attention(query, key, value, attn_mask=mask)
            attended[span] = of_heads[0].transpose(0, 1).flatten(1)
        for part, values in self._parts(tokens, attended):
            self._add_scaled(part, self._linear(values, f"{block}.attn.proj"), f"{block}.ls1")

    def _add_mlp(self, tokens: Tensor, block: str, work: BufferPool) -> None:
        branch = self._gated_mlp if self.model.gated_mlp else self._mlp
        for (part,) in self._parts(tokens):
            self._add_scaled(part, branch(self._layer_norm(part, f"{block}.norm2"), f"{block}.mlp", work), f"{block}.ls2")

    def _mlp(self, tokens: Tensor, name: str, work: BufferPool) -> Tensor:
        import torch

        hidden = self._rows(work, "hidden", len(tokens), 4 * tokens.shape[1])
        torch.ops.aten.gelu_(self._linear(tokens, f"{name}.fc1", hidden))
        return self._linear(hidden, f"{name}.fc2")

    def _gated_mlp(self, tokens: Tensor, name: str, work: BufferPool) -> Tensor:
        """SwiGLU: W3 (silu(W1 x) ∘ W2 x) (Shazeer, GLU Variants Improve Transformer, 2020)."""
        import torch.nn.functional as F

        gate, hidden = (self._rows(work, buffer, len(tokens), 4 * tokens.shape[1]) for buffer in ("gate", "hidden"))
        F.silu(self._linear(tokens, f"{name}.w1", gate), inplace=True)
        return self._linear(self._linear(tokens, f"{name}.w2", hidden).mul_(gate), f"{name}.w3")

    def _parts(self, *arrays: Tensor) -> Iterator[tuple[Tensor, ...]]:
        """The rows of arrays that go through a layer at once; all of them on a GPU, where each call costs time."""
        rows = ROWS_AT_ONCE if self.device.type == "cpu" else len(arrays[0])
        return zip(*(array.split(rows) for array in arrays), strict=True)

    def _keys(self, tokens: Tensor, block: str) -> Tensor:
        """Only the key third of the block's qkv projection: nothing after it is ever read.

        Keys before rotary positions turn them: features are compared across places and averaged over slicing directions, in
        which one place has different angles. Turned, equal content at two places would be dissimilar.
        """
        import torch.nn.functional as F

        channels = self.model.embed_dim
        weight = self._weights[f"{block}.attn.qkv.weight"][channels : 2 * channels]
        bias = self._weights[f"{block}.attn.qkv.bias"][channels : 2 * channels]
        return F.linear(self._layer_norm(tokens, f"{block}.norm1"), weight, bias)

    def _layer_norm(self, tokens: Tensor, name: str) -> Tensor:
        import torch.nn.functional as F

        w = self._weights
        return F.layer_norm(tokens, tokens.shape[-1:], w[f"{name}.weight"], w[f"{name}.bias"], self.model.layer_norm_epsilon)

    def _linear(self, tokens: Tensor, name: str, out: Tensor | None = None) -> Tensor:
        import torch

        return torch.addmm(self._weights[f"{name}.bias"], tokens, self._weights[f"{name}.weight"].T, out=out)

    def _add_scaled(self, tokens: Tensor, residual: Tensor, name: str) -> None:
        if self.model.layer_scale:
            tokens.addcmul_(residual, self._weights[f"{name}.gamma"])
        else:
            tokens.add_(residual)

    def _rows(self, work: BufferPool, name: str, rows: int, columns: int) -> Tensor:
        return work.rows(name, rows, columns, self.dtype, self.device)


def _masked(state_dict: dict[str, Tensor]) -> dict[str, Tensor]:
    """Biases times their masks, where there are such: DINOv3 masks the keys' biases out, which are not zero by themselves."""
    return {
        name: tensor * state_dict[f"{name}_mask"] if f"{name}_mask" in state_dict else tensor
        for name, tensor in state_dict.items()
    }
