"""A vision transformer that computes the attention keys of its last block: the features of the method (paper §III-A).

Dosovitskiy et al., An Image is Worth 16×16 Words, 2021; Caron et al., Emerging Properties in Self-Supervised Vision
Transformers, 2021 (DINO); Oquab et al., DINOv2, 2023; Darcet et al., Vision Transformers Need Registers, 2023; Siméoni et al.,
DINOv3, 2025.

It is for inference only, so there are no PyTorch modules: the network consists of the published state dict and the functions
below, which look up every weight by its published name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..core.system.progress import Between, nothing_between
from ..weights.models import PretrainedModel
from .buffer_pool import BufferPool
from .expected_shapes import check_state_dict, expected_shapes, register_name
from .packed_slices import PackedSlices, PatchTokens
from .position_table import PositionTable
from .rotary_positions import RotaryPositions, rotate

if TYPE_CHECKING:
    import torch
    from torch import Tensor

ROWS_AT_ONCE = 1024
"""Rows that pass a layer at once on a CPU, in each thread, so that intermediate results stay in its cache."""


class VisionTransformer:
    """A ViT with fixed weights that computes the keys of its last block.

    Args:
        model: the architecture.
        state_dict: the weights by their published names, of any floating dtype.
        weights_digest: identifies the weights, as a key for cached results.
        device: the device to compute on.
        dtype: the precision to compute in; None: float32.

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
        # Converted to float32 first: Apple's GPUs have no bfloat16 before macOS 14.
        self._rotary = None if periods is None else RotaryPositions(periods.float().to(self.device))

    def converted(self, device: torch.device | str, dtype: torch.dtype) -> VisionTransformer:
        """The same network on a device and in a precision; this object itself if it already has both."""
        import torch

        if (self.device, self.dtype) == (torch.device(device), dtype):
            return self
        return VisionTransformer(self.model, self._weights, self.weights_digest, device, dtype)

    def first_blocks(self, depth: int) -> VisionTransformer:
        """A network of the first `depth` blocks only, to measure the time of a block; its keys are not features."""
        model = replace(self.model, depth=depth)
        weights = {name: self._weights[name] for name in expected_shapes(model)}
        return VisionTransformer(model, weights, self.weights_digest, self.device, self.dtype)

    def keys_of_tokens(
        self, slices: Sequence[PatchTokens], buffers: BufferPool | None = None, between: Between = nothing_between
    ) -> Tensor:
        """Keys `K` of the last block's self-attention, with heads concatenated, without class and register tokens.

        There is no attention between slices. Slices may lack some of their patches.

        Args:
            slices: the slices of one batch.
            buffers: memory to reuse from batch to batch; None: new memory.
            between: called before each block; may raise `Cancelled`.

        Returns:
            The keys of all patches, slice by slice, (T, C), on the network's device and in its precision.
        """
        import torch

        with torch.inference_mode():
            packed = PackedSlices(slices, 1 + self.model.num_register_tokens)
            work = buffers or BufferPool()
            tokens = self._embed(slices, packed, work)
            biases = [self._attention_bias(group, span) for group, span in zip(slices, packed.spans, strict=True)]
            rotations = () if self._rotary is None else self._rotary.rotations(slices, packed, work)
            for block in range(self.model.depth - 1):
                between()
                self._add_attention(tokens, packed.spans, biases, rotations, f"blocks.{block}", work)
                self._add_mlp(tokens, f"blocks.{block}", work)
            keys = self._keys(tokens, f"blocks.{self.model.depth - 1}")
            return torch.cat([keys[patches] for patches in packed.patches])

    def _embed(self, slices: Sequence[PatchTokens], packed: PackedSlices, work: BufferPool) -> Tensor:
        """Tokens (R, C): for each slice the class token, the registers and the patches; padding is zero."""
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
        """The bias of attention logits, (1, rows of the slice), by which a token that represents n patches counts n times.

        Adding log n to the logit of a key is equivalent to n equal keys (Bolya et al., Token Merging, 2023, Eq. 1). Padding has
        n = 0, and therefore no weight. None if all tokens count once.
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
        """Add the self-attention of a block to the tokens (R, C).

        Attention is computed within each slice, whose rows are one of the `spans`. `rotations` are the cosines and sines by
        which queries and keys are rotated; empty without rotary positions.
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
        """Split arrays into the rows that pass a layer at once; on a GPU, where each call takes time, these are all rows."""
        rows = ROWS_AT_ONCE if self.device.type == "cpu" else len(arrays[0])
        return zip(*(array.split(rows) for array in arrays), strict=True)

    def _keys(self, tokens: Tensor, block: str) -> Tensor:
        """The keys of a block, (R, C): only this third of the qkv projection is computed, since nothing else is needed.

        They are not rotated by rotary positions: features are compared across positions and averaged over slicing directions,
        in which one position has different angles. After rotation, equal content at two positions would be dissimilar.
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
    """Multiply biases by their masks, if any: DINOv3 masks out the keys' biases, whose stored values are not zero."""
    return {
        name: tensor * state_dict[f"{name}_mask"] if f"{name}_mask" in state_dict else tensor
        for name, tensor in state_dict.items()
    }
