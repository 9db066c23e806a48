"""From the names that the package transformers, and so Hugging Face's site, gives DINOv3's tensors, to Meta's."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

_RENAMED = {
    r"^embeddings\.register_tokens$": r"storage_tokens",
    r"^embeddings\.patch_embeddings\.": r"patch_embed.proj.",
    r"^embeddings\.": r"",
    r"^layer\.": r"blocks.",
    r"\.attention\.o_proj\.": r".attn.proj.",
    r"\.layer_scale(\d)\.lambda1$": r".ls\1.gamma",
}
_RENAMED_MLP = {r"\.mlp\.up_proj\.": r".mlp.fc1.", r"\.mlp\.down_proj\.": r".mlp.fc2."}
_RENAMED_GATED_MLP = {
    r"\.mlp\.gate_proj\.": r".mlp.w1.",
    r"\.mlp\.up_proj\.": r".mlp.w2.",
    r"\.mlp\.down_proj\.": r".mlp.w3.",
}
_PERIODS = 16
"""A quarter of a head's 64 channels."""


def has_transformers_names(tensors: dict[str, Tensor]) -> bool:
    """Whether these are DINOv3's tensors as transformers names them."""
    return "embeddings.register_tokens" in tensors


def with_published_names(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors as Meta's files have them; what is unknown, or lacks its like, keeps its name.

    Query, key and value are one tensor there. The keys' biases, and the periods of the rotary positions, which transformers
    leaves out because they are zero and always the same, are there.
    """
    import torch

    gated = any(".mlp.gate_proj." in name for name in tensors)
    renamed = _RENAMED | (_RENAMED_GATED_MLP if gated else _RENAMED_MLP)
    published = {_substituted(name, renamed): tensor for name, tensor in tensors.items()}
    for query_name in [name for name in published if name.endswith(".attention.q_proj.weight")]:
        _join_attention(published, query_name.removesuffix(".attention.q_proj.weight"))
    published["rope_embed.periods"] = 100.0 ** (torch.arange(_PERIODS) / _PERIODS)
    return published


def _substituted(name: str, patterns: dict[str, str]) -> str:
    for pattern, replacement in patterns.items():
        name = re.sub(pattern, replacement, name)
    return name


def _join_attention(tensors: dict[str, Tensor], block: str) -> None:
    """Put one tensor in the place of query, key and value of a block: weights, biases, and the biases' mask."""
    import torch

    weights = [f"{block}.attention.{part}_proj.weight" for part in "qkv"]
    query_bias, value_bias = biases = [f"{block}.attention.{part}_proj.bias" for part in "qv"]
    if not all(name in tensors for name in (*weights, *biases)) or len({tensors[name].shape for name in weights}) > 1:
        return
    one, zero = torch.ones_like(tensors[query_bias]), torch.zeros_like(tensors[query_bias])
    tensors[f"{block}.attn.qkv.weight"] = torch.cat([tensors.pop(name) for name in weights])
    tensors[f"{block}.attn.qkv.bias"] = torch.cat([tensors.pop(query_bias), zero, tensors.pop(value_bias)])
    tensors[f"{block}.attn.qkv.bias_mask"] = torch.cat([one, zero, one])
